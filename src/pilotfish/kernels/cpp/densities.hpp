// Datapoints in blocks for vector registers, and the densities of Gaussians at them.
// Defined by kernels/reference/emission.py.
#pragma once

#include <algorithm>
#include <vector>

#include "lanes.hpp"

namespace pilotfish {

// P frames, N datapoints in all, K states, D columns; arrays are C-contiguous.
struct Sizes {
  int P;
  long N;
  int K, D;
  std::vector<int> orientation_starts;  // first columns of the unit quaternions, increasing
  int E() const { return D - int(orientation_starts.size()); }  // columns of a deviation
  int rows() const { return (E() + 3) / 4 * 4; }                // E padded to a multiple of 4
};

constexpr int PAGE = 8;              // blocks of a page
constexpr int STEPS = PAGE * BLOCK;  // time steps of a page

// Up to STEPS consecutive datapoints of one frame, in the order block, column, step; padded with zeros.
class Page {
 public:
  explicit Page(const Sizes& sizes) : D_(sizes.D), x_(size_t(PAGE) * D_ * BLOCK) {}
  void read(const double* x, long steps);
  long blocks() const { return (steps_ + BLOCK - 1) / BLOCK; }
  long steps_in(long block) const { return std::min<long>(BLOCK, steps_ - block * BLOCK); }
  const double* block(long b) const { return x_.data() + b * D_ * BLOCK; }

 private:
  int D_;
  long steps_ = 0;
  Buffer x_;
};

// Computes error = x - mean for a block, with rotation vectors for orientations; padded rows are not written.
void deviations(const double* block, const double* mean, const Sizes& sizes, double* error);

// Densities of K Gaussians in each of P frames; lower triangles of W are packed in the order of their use.
class Densities {
 public:
  Densities(const Sizes& sizes, const double* means, const double* precision_cholesky);

  // Computes log_density[n * stride + k] = sum over frames p of log N(x[p, begin + n]), for begin + n < end.
  void evaluate(const double* x, long begin, long end, double* log_density, long stride);

 private:
  void add(int p, int k, double* log_density, long stride);
  double* triangle(int p, int k) { return triangles_.data() + (size_t(p) * sizes_.K + k) * packed_; }

  Sizes sizes_;
  const double* means_;
  size_t packed_;  // numbers of one packed triangle
  Buffer triangles_;
  std::vector<double> constants_;  // (P, K), log density at the mean
  Page page_;
  Buffer error_;
};

}  // namespace pilotfish
