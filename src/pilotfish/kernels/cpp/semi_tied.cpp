#include "semi_tied.hpp"

#include <Eigen/LU>
#include <cmath>

#include "lanes.hpp"

namespace pilotfish {

namespace {

using Matrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
using Vector = Eigen::VectorXd;

// Replaces the upper triangle of G by the transpose of its Cholesky factor; returns false if there is none.
bool factorise(Matrix& G) {
  const Eigen::Index D = G.rows();
  for (Eigen::Index j = 0; j < D; ++j) {
    const double pivot = G(j, j);
    if (!(pivot > 0.0 && pivot < std::numeric_limits<double>::infinity())) return false;
    G.row(j).tail(D - j) /= std::sqrt(pivot);
    for (Eigen::Index i = j + 1; i < D; ++i) G.row(i).tail(D - i) -= G(j, i) * G.row(j).tail(D - i);
  }
  return true;
}

// Replaces x by the solution y of U^T U y = x.
void solve(const Matrix& U, Vector& x) {
  const Eigen::Index D = x.size();
  for (Eigen::Index i = 0; i < D; ++i) {
    x[i] /= U(i, i);
    x.tail(D - i - 1) -= x[i] * U.row(i).tail(D - i - 1).transpose();
  }
  for (Eigen::Index i = D - 1; i >= 0; --i)
    x[i] = (x[i] - U.row(i).tail(D - i - 1).dot(x.tail(D - i - 1))) / U(i, i);
}

}  // namespace

int semi_tied_sweeps(int K, int D, const double* covariances, const double* counts, double* transform,
                     int sweeps) {
  Eigen::Map<Matrix> B(transform, D, D);
  Matrix inverse(D, D), G(D, D);
  Vector cofactors(D), direction(D), change(D), image(D);
  const double count_sum = sum_in_order(counts, K);
  const auto covariance = [&](int k) {
    return Eigen::Map<const Matrix>(covariances + size_t(k) * D * D, D, D);
  };
  for (int sweep = 0; sweep < sweeps; ++sweep) {
    inverse = B.inverse();
    if (!inverse.allFinite()) return D;
    for (int d = 0; d < D; ++d) {
      G.setZero();
      for (int k = 0; k < K; ++k) {
        image.noalias() = covariance(k) * B.row(d).transpose();
        const double variance = B.row(d).dot(image);
        if (!(variance > 0.0)) return d;
        G += (counts[k] / variance) * covariance(k);
      }
      cofactors = inverse.col(d);  // row d of B^-T
      if (!factorise(G)) return d;
      direction = cofactors;
      solve(G, direction);
      direction *= std::sqrt(count_sum / cofactors.dot(direction));
      change.noalias() = inverse.transpose() * (direction - B.row(d).transpose());
      inverse.noalias() -= cofactors * (change / (1.0 + change[d])).transpose();
      B.row(d) = direction.transpose();
    }
  }
  return -1;
}

}  // namespace pilotfish
