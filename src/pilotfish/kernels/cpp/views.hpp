// Datapoints laid out for vector registers, and the Gaussians that read them.
#pragma once

#include <algorithm>
#include <vector>

#include "lanes.hpp"

namespace pilotfish {

// P frames, N datapoints in all, K states, D dimensions; arrays are C-contiguous.
struct Sizes {
  int P;
  long N;
  int K, D;
  int rows() const { return (D + 3) / 4 * 4; }  // dimensions padded, so that tiles of four need no remainder
};

constexpr int PAGE = 8;              // blocks of a page
constexpr int STEPS = PAGE * BLOCK;  // time steps of a page

// Up to STEPS consecutive datapoints of one frame, dimension by dimension: block, row, step. Padding is zero.
class Page {
 public:
  explicit Page(Sizes sizes) : D_(sizes.D), rows_(sizes.rows()), x_(size_t(PAGE) * rows_ * BLOCK) {}
  void read(const double* x, long steps);
  long blocks() const { return (steps_ + BLOCK - 1) / BLOCK; }
  long steps_in(long block) const { return std::min<long>(BLOCK, steps_ - block * BLOCK); }
  const double* block(long b) const { return x_.data() + b * rows_ * BLOCK; }

 private:
  int D_, rows_;
  long steps_ = 0;
  Buffer x_;
};

// error[i] = x[i] - mean[i] for a block; error's padded rows stay as they are.
void deviations(const double* block, const double* mean, int D, double* error);

// Densities of K Gaussians in each of P frames; the whiteners' lower triangles are packed as they are used.
class Densities {
 public:
  Densities(Sizes sizes, const double* means, const double* whiteners);

  // log_density[n * stride + k] = sum over frames of log N(x[p, begin + n]) for the datapoints begin to end.
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
