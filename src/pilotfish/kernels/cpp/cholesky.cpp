#include "cholesky.hpp"

#include <algorithm>
#include <cmath>

#include "lanes.hpp"

namespace pilotfish {

namespace {

// Subtracts sum over j < count of factor[j * step] rows[j] from target, in columns begin to end, multiples of
// LANES.
void subtract(double* target, const double* factor, long step, const double* rows, long stride, int count,
              long begin, long end) {
  for (long c = begin; c < end; c += LANES) {
    Lanes<LANES> even = lanes<LANES>(target + c), odd = Lanes<LANES>::Zero();
    int j = 0;
    for (; j + 1 < count; j += 2) {
      even -= factor[j * step] * lanes<LANES>(rows + j * stride + c);
      odd -= factor[(j + 1) * step] * lanes<LANES>(rows + (j + 1) * stride + c);
    }
    if (j < count) even -= factor[j * step] * lanes<LANES>(rows + j * stride + c);
    lanes<LANES>(target + c) = even + odd;
  }
}

// Factorises one covariance at a time, in rows padded to a multiple of LANES.
class Factorisation {
 public:
  explicit Factorisation(int D)
      : D_(D),
        width_((D + LANES - 1) / LANES * LANES),
        factor_(size_t(D) * width_, 0.0),
        inverse_(factor_.size()) {}

  bool precision_cholesky(const double* covariance, double* W) {
    if (!factorise(covariance)) return false;
    invert();
    for (int i = 0; i < D_; ++i) {
      std::copy_n(inverse_.data() + i * width_, i + 1, W + i * D_);
      std::fill_n(W + i * D_ + i + 1, D_ - i - 1, 0.0);
    }
    return true;
  }

 private:
  // Computes U with U^T U = covariance, upper triangular, row by row.
  bool factorise(const double* covariance) {
    for (int i = 0; i < D_; ++i) {
      double* row = factor_.data() + i * width_;
      std::fill_n(row, i, 0.0);
      for (int j = i; j < D_; ++j) row[j] = covariance[j * D_ + i];
      subtract(row, factor_.data() + i, width_, factor_.data(), width_, i, i / LANES * LANES, width_);
      if (!(row[i] > 0.0) || !std::isfinite(row[i])) return false;
      const double scale = 1.0 / std::sqrt(row[i]);
      for (int j = i; j < D_; ++j) row[j] *= scale;
    }
    return true;
  }

  // Computes U^-T, row by row.
  void invert() {
    for (int i = 0; i < D_; ++i) {
      double* row = inverse_.data() + i * width_;
      std::fill_n(row, width_, 0.0);
      subtract(row, factor_.data() + i, width_, inverse_.data(), width_, i, 0,
               (i + LANES - 1) / LANES * LANES);
      const double scale = 1.0 / factor_[i * width_ + i];
      for (int j = 0; j < i; ++j) row[j] *= scale;
      row[i] = scale;
    }
  }

  int D_;
  long width_;
  Buffer factor_, inverse_;
};

}  // namespace

long precision_cholesky(long K, int D, const double* covariances, double* W) {
  Factorisation factorisation(D);
  const size_t size = size_t(D) * D;
  for (long k = 0; k < K; ++k)
    if (!factorisation.precision_cholesky(covariances + k * size, W + k * size)) return k;
  return -1;
}

}  // namespace pilotfish
