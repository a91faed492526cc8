// The expectation steps of task-parameterised hidden Markov and semi-Markov models.
#pragma once

#include "semi_markov.hpp"
#include "densities.hpp"

namespace pilotfish {

// M demonstrations end to end in x (P, N, D).
struct Demonstrations {
  const double* x;
  const int64_t* lengths;
  long M;
};

struct Gaussians {
  const double *means, *precision_cholesky;
};

// What every sum is added up into; see EStep and SemiMarkovEStep in results.py.
struct Sums {
  double *log_likelihoods, *counts, *initial_counts, *transitions, *offsets, *scatter_matrices, *segments, *tail_counts;
};

// Up to `threads` threads share the demonstrations, as many as this process may use if it is zero. The sums
// do not depend on it. Memory beyond the sums is that of a few more of them, and of the longest
// demonstration for every thread.
void e_step(const Sizes& sizes, Demonstrations data, const Chain& chain, Gaussians gaussians, int threads,
            Sums sums);
void e_step(const Sizes& sizes, Demonstrations data, const SemiMarkovChain& chain, Gaussians gaussians,
            int threads, Sums sums);

}  // namespace pilotfish
