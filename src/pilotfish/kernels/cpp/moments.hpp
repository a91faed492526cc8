// Weighted first and second moments of deviations from given means.
#pragma once

#include "densities.hpp"

namespace pilotfish {

// Accumulates sum gamma e and sum gamma e e^T, e = deviation from the mean, for every frame and state.
class Moments {
 public:
  Moments(const Sizes& sizes, const double* means, double* offsets, double* scatter_matrices);

  // Adds datapoints begin .. end - 1 with weights gamma[n * stride + k]. Weights below min_weights[k] are
  // taken as zero, and blocks without other weights are skipped.
  void add(const double* x, long begin, long end, const double* gamma, long stride,
           const double* min_weights);

  // Completes the scatter matrices: until then their upper triangles are missing.
  void finish();

 private:
  void add_state(size_t state, const double* gamma, long stride, double min_weight);
  void add_block(const double* weights);
  void collect(size_t state);

  Sizes sizes_;
  const double* means_;
  double* offsets_;
  double* scatters_;
  Page page_;
  Buffer error_, weighted_;  // (rows, BLOCK) of one state and block
  Buffer first_, second_;    // sums over a page, REGISTER partial sums for each number
};

}  // namespace pilotfish
