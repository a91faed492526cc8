// Forward-backward, filtering and Viterbi of a semi-Markov chain. See semi_markov_lattice.hpp for the
// offsets, and kernels/reference/semi_markov.py for the recursions.
#pragma once

#include "semi_markov_lattice.hpp"

namespace pilotfish {

// Inference in one demonstration after another, which sums the expected counts.
class SemiMarkovInference {
 public:
  // Allocates memory for demonstrations of up to max_duration steps.
  SemiMarkovInference(const SemiMarkovChain& chain, long max_duration);

  // Computes state probabilities (T, K) from log_emissions (T, K). Returns log p(all steps); at -inf nothing
  // is added or written.
  double infer(const double* log_emissions, long T, double* smoothed_state_probs);

  // Adds the expected counts of all demonstrations: transitions (K, K), segments (4, S, K), long_segment_counts (2,
  // K).
  void add_to(double* transition_counts, double* segments, double* long_segment_counts) const;

 private:
  void forward();
  double log_likelihood();
  double log_likelihood_relative_to_best_path(const double* log_emissions, long T);
  void backward(double log_likelihood);
  double backward_step(long b, int k, double log_likelihood);
  void add_transitions(long b);
  void write(double* smoothed_state_probs);
  double* segments(int kind, int k) {
    return segments_.data() + (size_t(kind) * chain_.states() + k) * chain_.stride();
  }

  const SemiMarkovChain& chain_;
  Lattice lattice_;
  Buffer starting_, ending_;  // (K, capacity), expected segments that begin at b, that end before t
  Buffer remaining_, after_;  // (K), sum of emissions until the end; after_starts
  Buffer transition_counts_, segments_,
      long_segment_counts_;  // (K, K), (4, K, stride), (2, K): sums over demonstrations
};

// Computes log_segment_ends and log_forward (T, K), as if the recording ended at each step.
void forward(const SemiMarkovChain& chain, const double* log_emissions, long T, double* log_segment_ends,
             double* log_forward);

// Writes the most probable path to states (T); returns its log-probability.
double viterbi(const SemiMarkovChain& chain, const double* log_emissions, long T, int64_t* states);

}  // namespace pilotfish
