// The expectation step of a task-parameterised hidden Markov model.
#pragma once

#include "views.hpp"

namespace pilotfish {

struct Model {
  const double *log_initial, *transitions, *log_transitions, *means, *whiteners;
};

// What every sum is added up into; see EStep in results.py.
struct Sums {
  double *log_likelihoods, *mass, *first, *transitions, *offsets, *scatters;
};

// M demonstrations end to end in x (P, N, D); memory beyond the sums is that of the longest.
void e_step(Sizes sizes, const double* x, const int64_t* lengths, long M, Model model, Sums sums);

}  // namespace pilotfish
