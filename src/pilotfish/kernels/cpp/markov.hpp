// Inference along a Markov chain of K states, in logarithms, without losing a path to underflow.
#pragma once

#include "lanes.hpp"

namespace pilotfish {

// The states that each state is linked to, and log-probabilities of these transitions.
struct Neighbours {
  Neighbours(const double* log_transitions, int K, bool transposed);

  // log sum over neighbours i of exp(values[i] + log_probability[i]), exactly. terms is room to work in.
  double log_sum(int state, const double* values, double* terms) const;

  std::vector<int> begin;  // K + 1; those of state k are begin[k] to begin[k + 1]
  std::vector<int> states;
  std::vector<double> log_probabilities;
};

// sum[k] = sum over j of weight[j] rows[j, k], for K rows of a width that is a multiple of LANES.
void product(const double* weight, const double* rows, int K, int width, double* sum);

// The K states are padded with impossible ones to a width that is a multiple of LANES.
// Log-probabilities travel relative to a running offset, the best emission of every step and the best partial
// path, so that long chains lose no digits. A step multiplies exponentials by the transition matrix, and does
// again exactly what may have lost a path to underflow. Where the best partial path is a dead end, so that the
// paths that survive lie more than LARGEST_DROP below it, their differences are lost to rounding: posteriors are
// then computed from emissions relative to the best whole path (see semi_markov.hpp).
class Chain {
 public:
  // log_transitions must outlive the chain.
  Chain(int K, const double* log_initial, const double* transitions, const double* log_transitions);

  int states() const { return K_; }
  int width() const { return width_; }
  const double* initial() const { return initial_.data(); }  // (width)
  const double* from() const { return from_.data(); }        // (K, width), row j: to every k
  const double* into() const { return into_.data(); }        // (K, width), row k: from every j

  // forward[t] + offsets[t] = log p(steps 0 to t, state at t). Returns log p(all steps). drop becomes the
  // largest one of the best partial path within a step.
  double forward(const double* log_emissions, long T, double* forward, double* offsets, double* drop) const;

  // Turns forward (T, width) into posteriors and adds the expected transitions to counts (K, K).
  // The likelihood must not be zero. drop is that of the forward pass.
  void backward(const double* log_emissions, long T, double* forward, double* transition_counts, double drop) const;

 private:
  struct Step;

  void beside_best_path(const double* log_emissions, long T, double* smoothed_state_probs, double* transition_counts) const;
  void backward_step(Step& step, double* later) const;
  void add_transitions(Step& step, const double* gamma) const;

  int K_, width_;
  const double* log_transitions_;
  Buffer log_initial_, initial_;
  Buffer from_, into_;               // padded with ones
  Neighbours successors_, origins_;  // of every state
};

// For arrays that are not padded: posteriors and log_forward (T, K), counts (K, K), all of them set.
double forward_backward(const Chain& chain, const double* log_emissions, long T, double* smoothed_state_probs,
                        double* transition_counts, double* log_forward);

// A most probable path into states (T), at ties the lower index; returns its log-probability. Rows of
// log_emissions lie stride numbers apart.
double viterbi(int K, long T, const double* log_emissions, long stride, const double* log_initial,
               const double* log_transitions, int64_t* states);

}  // namespace pilotfish
