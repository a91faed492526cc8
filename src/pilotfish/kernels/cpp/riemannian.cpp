#include "riemannian.hpp"

#include <Eigen/Core>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <vector>

namespace pilotfish {

namespace {

using Vector = Eigen::VectorXd;
using Matrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
using MatrixView = Eigen::Map<const Matrix>;

constexpr int MAX_ITERATIONS = 100, HALVINGS = 20;
constexpr double TOLERANCE = 1e-10;
constexpr double ROUNDING = 1e-9;  // relative error of the cost

// The product over frames of one state.
class Product {
 public:
  Product(const Manifold& manifold, const FrameGaussians& given)
      : manifold_(manifold), given_(given), D_(manifold.D), E_(manifold.E()), v_(given.P, E_), next_(given.P, E_) {}

  void compute(int k, double* mean, double* covariance) {
    k_ = k;
    Vector x = nearest_mean(), point(D_), step(E_);
    Matrix C;
    double lowest = lead_to(x, v_);
    for (int iteration = 0; iteration < MAX_ITERATIONS; ++iteration) {
      tangent_product(step, C);
      double size = 1.0, cost = lowest;
      for (int n = 0; n < HALVINGS; ++n, size *= 0.5) {
        const Vector shorter = size * step;
        displace(manifold_, x.data(), shorter.data(), point.data());
        cost = lead_to(point, next_);
        if (cost < lowest) break;
      }
      if (!(cost < lowest) || step.cwiseAbs().maxCoeff() <= TOLERANCE) break;
      x = point;
      v_ = next_;
      lowest = cost;
    }
    displace(manifold_, x.data(), step.data(), point.data());  // more exact than x where only rounding is left
    const bool jumps = lead_to(point, next_) > (1.0 + ROUNDING) * lowest;  // at a half turn from a mean
    std::copy_n((jumps ? x : point).data(), D_, mean);
    std::copy_n(C.data(), E_ * E_, covariance);
  }

 private:
  const double* mean_of(int p) const { return given_.means + (size_t(p) * given_.K + k_) * D_; }
  MatrixView matrix(const double* all, int p) const {
    return {all + (size_t(p) * given_.K + k_) * E_ * E_, E_, E_};
  }

  // Writes the tangent vectors from the means to x; returns their cost.
  double lead_to(const Vector& x, Matrix& v) const {
    double cost = 0.0;
    for (int p = 0; p < given_.P; ++p) {
      deviation(manifold_, mean_of(p), x.data(), v.row(p).data());
      const auto W = matrix(given_.precision_cholesky, p);
      cost += (W.triangularView<Eigen::Lower>() * v.row(p).transpose()).squaredNorm();
    }
    return cost;
  }

  // Returns the mean of lowest cost.
  Vector nearest_mean() {
    Vector nearest = Eigen::Map<const Vector>(mean_of(0), D_);
    double lowest = lead_to(nearest, next_);
    for (int p = 1; p < given_.P; ++p) {
      const Vector mean = Eigen::Map<const Vector>(mean_of(p), D_);
      const double cost = lead_to(mean, next_);
      if (cost < lowest) nearest = mean, lowest = cost;
    }
    return nearest;
  }

  // Writes mean and covariance of the product in the tangent space at the point that v_ leads to.
  void tangent_product(Vector& mean, Matrix& covariance) const {
    Matrix J(E_, E_);
    for (int p = 0; p < given_.P; ++p) {
      displacement_jacobian(manifold_, v_.row(p).data(), J.data());
      const Matrix other = J * matrix(given_.covariances, p) * J.transpose();
      if (p == 0) {
        mean = -v_.row(p).transpose();
        covariance = other;
        continue;
      }
      const Matrix sum = covariance + other;
      const Matrix gain = sum.partialPivLu().solve(covariance).transpose();  // Sp (Sp + Sq)^-1
      mean -= gain * (v_.row(p).transpose() + mean);
      const Matrix product = gain * other;
      covariance = 0.5 * (product + product.transpose());
    }
  }

  const Manifold& manifold_;
  const FrameGaussians& given_;
  const int D_, E_;
  int k_ = 0;
  Matrix v_, next_;  // tangent vectors (P, E) from the means to the present point and to the next
};

}  // namespace

void riemannian_product(const Manifold& manifold, const FrameGaussians& given, double* means,
                        double* covariances) {
  Product product(manifold, given);
  const size_t D = manifold.D, E = manifold.E();
  for (int k = 0; k < given.K; ++k) product.compute(k, means + k * D, covariances + k * E * E);
}

}  // namespace pilotfish
