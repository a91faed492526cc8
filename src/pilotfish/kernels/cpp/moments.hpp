// Weighted first and second moments of datapoints about given means.
#pragma once

#include "densities.hpp"

namespace pilotfish {

// Adds up  sum gamma e  and  sum gamma e e^T,  e the deviation from the mean, for every frame and state.
class Moments {
 public:
  Moments(const Sizes& sizes, const double* means, double* offsets, double* scatter_matrices);

  // The datapoints begin to end, gamma[n * stride + k] their share of state k; shares below least[k] count
  // as none, and blocks without any are passed over.
  void add(const double* x, long begin, long end, const double* gamma, long stride, const double* least);

  // Only now are the scatters whole: until here their upper triangles are missing.
  void finish();

 private:
  void add_state(size_t state, const double* gamma, long stride, double least);
  void add_block(const double* run_groups);
  void collect(size_t state);

  Sizes sizes_;
  const double* means_;
  double* offsets_;
  double* scatters_;
  Page page_;
  Buffer error_, weighted_;  // (rows, BLOCK) of one state and block
  Buffer first_, second_;    // sums over a page, REGISTER of them for each number
};

}  // namespace pilotfish
