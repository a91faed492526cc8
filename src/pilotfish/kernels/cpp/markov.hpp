// Forward-backward and Viterbi of a Markov chain of K states, in logarithms: no path is lost to underflow.
// Defined by kernels/reference/markov.py.
#pragma once

#include "lanes.hpp"

namespace pilotfish {

// Sparse transition matrix: the states linked to each state, and the log-probabilities of these transitions.
struct Neighbours {
  Neighbours(const double* log_transitions, int K, bool transposed);

  // Returns log sum over neighbours i of exp(values[i] + log_probability[i]), without underflow; terms is
  // scratch.
  double log_sum(int state, const double* values, double* terms) const;

  std::vector<int> begin;  // K + 1; neighbours of state k are entries begin[k] to begin[k + 1]
  std::vector<int> states;
  std::vector<double> log_probabilities;
};

// Computes sum[k] = sum over j of weight[j] rows[j, k], for K rows whose width is a multiple of LANES.
void product(const double* weight, const double* rows, int K, int width, double* sum);

// Markov chain, prepared for inference. The K states are padded with impossible ones to a multiple of LANES.
//
// Log-probabilities are stored relative to a running offset (the largest emission of every step, and the best
// partial path), so that long chains lose no digits. A step multiplies exponentials by the transition matrix.
// Sums that are so small that a term may have underflowed are computed again in logarithms. If the best
// partial path is a dead end, the surviving paths are more than MAX_DROP below it and their differences are
// lost to rounding. State probabilities are then computed from emissions relative to the most probable path
// (see semi_markov_lattice.hpp).
class Chain {
 public:
  // log_transitions must outlive the chain.
  Chain(int K, const double* log_initial, const double* transitions, const double* log_transitions);

  int states() const { return K_; }
  int width() const { return width_; }
  const double* initial() const { return initial_.data(); }  // (width)
  const double* from() const { return from_.data(); }        // (K, width), row j: a_jk
  const double* into() const { return into_.data(); }        // (K, width), row k: a_jk over j

  // Computes forward[t] + offsets[t] = log p(steps 0 to t, state at t). Returns log p(all steps). Sets drop
  // to the largest decrease of the best partial path in one step.
  double forward(const double* log_emissions, long T, double* forward, double* offsets, double* drop) const;

  // Replaces forward (T, width) by state probabilities and adds the expected transitions to transition_counts
  // (K, K). The likelihood must be positive. drop is that of the forward pass.
  void backward(const double* log_emissions, long T, double* forward, double* transition_counts,
                double drop) const;

 private:
  struct Step;

  void relative_to_best_path(const double* log_emissions, long T, double* smoothed_state_probs,
                             double* transition_counts) const;
  void backward_step(Step& step, double* later) const;
  void add_transitions(Step& step, const double* gamma) const;

  int K_, width_;
  const double* log_transitions_;
  Buffer log_initial_, initial_;
  Buffer from_, into_;  // padded with ones
  Neighbours successors_, origins_;
};

// Forward-backward with arrays that are not padded; sets smoothed_state_probs, log_forward (T, K) and
// transition_counts (K, K).
double forward_backward(const Chain& chain, const double* log_emissions, long T, double* smoothed_state_probs,
                        double* transition_counts, double* log_forward);

// Writes the most probable path to states (T), at ties the lower index; returns its log-probability. Rows of
// log_emissions are stride numbers apart.
double viterbi(int K, long T, const double* log_emissions, long stride, const double* log_initial,
               const double* log_transitions, int64_t* states);

}  // namespace pilotfish
