// Posteriors along a Markov chain by scaled probabilities, where these are certain to be right.
#pragma once

#include "markov.hpp"

namespace pilotfish {

// Rabiner 1989, section V.A: no logarithm is taken of what a step multiplies. Underflow could lose paths; what
// follows from a state is therefore never underestimated, which bounds the share of the posterior that lost
// paths can have. Unless that is below anything that matters, there is no answer.
class ScaledPass {
 public:
  // Room for demonstrations of up to `longest` steps.
  ScaledPass(const Chain& chain, long max_duration);

  // posteriors (T, width) from log_emissions (T, width), and the expected transitions added to counts
  // (K, K); of both, what is below 1e-120 is zero. False where this cannot be told so: then nothing is added,
  // and posteriors mean nothing.
  bool infer(const double* log_emissions, long T, double* smoothed_state_probs, double* transition_counts, double* log_likelihood);

 private:
  bool forward(const double* log_emissions, long T, double* log_likelihood);
  bool backward(long T, double* smoothed_state_probs);
  void add_transitions(long T, double* transition_counts) const;

  const Chain& chain_;
  Buffer emissions_;  // (T, width) relative to the largest of a step; then times what follows
  Buffer forward_;    // (T, width) p(state | steps so far) times its sum
  Buffer sums_;       // (T) of forward_
};

// Infers demonstrations one at a time, and adds up what is expected of all of them: by scaling, and in
// logarithms where that gives no answer.
class MarkovInference {
 public:
  // Room for demonstrations of up to `longest` steps.
  MarkovInference(const Chain& chain, long max_duration)
      : chain_(chain),
        scaled_(chain, max_duration),
        offsets_(max_duration),
        counts_(size_t(chain.states()) * chain.states(), 0.0) {}

  // posteriors (T, width) from log_emissions (T, width). Returns log p(all steps); at -inf nothing is added,
  // and posteriors mean nothing.
  double infer(const double* log_emissions, long T, double* smoothed_state_probs) {
    double log_likelihood;
    if (scaled_.infer(log_emissions, T, smoothed_state_probs, counts_.data(), &log_likelihood)) return log_likelihood;
    double drop;
    log_likelihood = chain_.forward(log_emissions, T, smoothed_state_probs, offsets_.data(), &drop);
    if (log_likelihood != NEVER) chain_.backward(log_emissions, T, smoothed_state_probs, counts_.data(), drop);
    return log_likelihood;
  }

  const Buffer& transitions() const { return counts_; }  // (K, K), expected over all demonstrations

 private:
  const Chain& chain_;
  ScaledPass scaled_;
  Buffer offsets_, counts_;
};

}  // namespace pilotfish
