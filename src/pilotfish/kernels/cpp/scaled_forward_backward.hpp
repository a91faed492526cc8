// Forward-backward of a Markov chain with scaled probabilities, used only if its error is certain to be
// negligible.
#pragma once

#include "markov.hpp"

namespace pilotfish {

// Scaled forward-backward, without logarithms inside a step (Rabiner 1989, section V.A). Underflow may lose
// paths. Backward variables are therefore never underestimated, which bounds the posterior probability of
// lost paths. If the bound is not negligible, `infer` returns false.
class ScaledPass {
 public:
  // Allocates memory for demonstrations of up to max_duration steps.
  ScaledPass(const Chain& chain, long max_duration);

  // Computes state probabilities (T, width) from log_emissions (T, width), and adds the expected transitions
  // to transition_counts (K, K); values below 1e-120 become zero. Returns false if the result may be wrong:
  // then nothing is added, and smoothed_state_probs is undefined.
  bool infer(const double* log_emissions, long T, double* smoothed_state_probs, double* transition_counts,
             double* log_likelihood);

 private:
  bool forward(const double* log_emissions, long T, double* log_likelihood);
  bool backward(long T, double* smoothed_state_probs);
  void add_transitions(long T, double* transition_counts) const;

  const Chain& chain_;
  Buffer emissions_;  // (T, width) relative to the largest of a step; later times the backward variable
  Buffer forward_;    // (T, width) p(state | steps so far), before normalisation
  Buffer sums_;       // (T) of forward_
};

// Inference in one demonstration after another, which sums the expected transitions. It uses scaling, and
// logarithms if scaling fails.
class MarkovInference {
 public:
  // Allocates memory for demonstrations of up to max_duration steps.
  MarkovInference(const Chain& chain, long max_duration)
      : chain_(chain),
        scaled_(chain, max_duration),
        offsets_(max_duration),
        counts_(size_t(chain.states()) * chain.states(), 0.0) {}

  // Computes state probabilities (T, width) from log_emissions (T, width). Returns log p(all steps); at -inf
  // nothing is added, and smoothed_state_probs is undefined.
  double infer(const double* log_emissions, long T, double* smoothed_state_probs) {
    double log_likelihood;
    if (scaled_.infer(log_emissions, T, smoothed_state_probs, counts_.data(), &log_likelihood))
      return log_likelihood;
    double drop;
    log_likelihood = chain_.forward(log_emissions, T, smoothed_state_probs, offsets_.data(), &drop);
    if (log_likelihood != NEVER)
      chain_.backward(log_emissions, T, smoothed_state_probs, counts_.data(), drop);
    return log_likelihood;
  }

  const Buffer& transition_counts() const { return counts_; }  // (K, K), over all demonstrations

 private:
  const Chain& chain_;
  ScaledPass scaled_;
  Buffer offsets_, counts_;
};

}  // namespace pilotfish
