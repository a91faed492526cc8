// E-steps of task-parameterised hidden Markov and semi-Markov models. Defined by
// kernels/reference/e_steps.py.
#pragma once

#include "densities.hpp"
#include "semi_markov.hpp"

namespace pilotfish {

// M demonstrations, one after the other in x (P, N, D). log_final has the log-weight of each state at the last
// step of a demonstration; null is 0 for all.
struct Demonstrations {
  const double* x;
  const int64_t* lengths;
  long M;
  const double* log_final = nullptr;
};

struct Gaussians {
  const double *means, *precision_cholesky;
};

// Arrays of the sums; see EStep in results.py.
struct Sums {
  double *log_likelihoods, *counts, *initial_counts, *transition_counts, *offsets, *scatter_matrices,
      *segments, *long_segment_counts;
};

// Computes the sums on up to `threads` threads; zero means all cores of this process. The sums do not depend
// on the number of threads. Work memory is a few times the sums, and the longest demonstration for every
// thread.
void e_step(const Sizes& sizes, Demonstrations data, const Chain& chain, Gaussians gaussians, int threads,
            Sums sums);
void e_step(const Sizes& sizes, Demonstrations data, const SemiMarkovChain& chain, Gaussians gaussians,
            int threads, Sums sums);

}  // namespace pilotfish
