#include "riccati.hpp"

#include <Eigen/Cholesky>

#include "lanes.hpp"

namespace pilotfish {

namespace {

using Matrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
using Vector = Eigen::VectorXd;
using GivenMatrix = Eigen::Map<const Matrix>;
using GivenVector = Eigen::Map<const Vector>;

}  // namespace

// Results are computed in matrices that Eigen allocates, then copied: see sum_in_order in lanes.hpp.
long riccati(Tracking problem, Gains result) {
  const long T = problem.T, n = problem.n, m = problem.m;
  const GivenMatrix R(problem.control_cost, m, m);
  Matrix PA(n, n), PB(n, m), S(m, m), G(m, n), Y(m, n), K(m, n), V(n, n);
  Vector state_gradient(n), control_gradient(m), cost_gradient(n), drift(n);
  Eigen::LLT<Matrix> factor(m);
  const auto value = [&](long t) { return Eigen::Map<Matrix>(result.values + t * n * n, n, n); };
  const auto gradient = [&](long t) { return Eigen::Map<Vector>(result.gradients + t * n, n); };
  const auto weight = [&](long t) { return GivenMatrix(problem.weights + t * n * n, n, n); };
  const auto target = [&](long t) { return GivenVector(problem.targets + t * n, n); };
  value(T - 1) = weight(T - 1);
  gradient(T - 1).setZero();
  for (long t = T - 2; t >= 0; --t) {
    const long index = problem.varying ? t : 0;
    const GivenMatrix A(problem.A + index * n * n, n, n), B(problem.B + index * n * m, n, m);
    const auto P = value(t + 1);
    PA.noalias() = P * A;
    PB.noalias() = P * B;
    S = R;
    S.noalias() += B.transpose() * PB;
    factor.compute(S);
    if (factor.info() != Eigen::Success) return t;
    G.noalias() = PB.transpose() * A;
    Y = factor.matrixL().solve(G);  // K = L^-T Y, and A^T P B K = Y^T Y
    K = factor.matrixU().solve(Y);
    Eigen::Map<Matrix>(result.gains + t * m * n, m, n) = K;
    V = weight(t);
    V.noalias() += A.transpose() * PA;
    V.noalias() -= Y.transpose() * Y;
    value(t) = 0.5 * (V + V.transpose());
    drift.noalias() = A * target(t);
    drift -= target(t + 1);
    state_gradient.noalias() = P * drift;
    state_gradient += gradient(t + 1);
    control_gradient.noalias() = B.transpose() * state_gradient;
    cost_gradient.noalias() = A.transpose() * state_gradient;
    cost_gradient.noalias() -= K.transpose() * control_gradient;
    gradient(t) = cost_gradient;
    factor.solveInPlace(control_gradient);
    Eigen::Map<Vector>(result.feedforwards + t * m, m) = -control_gradient;
  }
  return -1;
}

}  // namespace pilotfish
