#include "scaled_forward_backward.hpp"

#include <algorithm>
#include <cmath>

namespace pilotfish {

namespace {

// Bounds. Backward variables are at most MAX_BACKWARD, and the backward pass adds FLOOR to them. The terms
// that it may lose - fewer than 1e7, each at most 1e160 times an emission below 1e-307 - are less than FLOOR,
// so that backward variables are never underestimated. A path that the forward pass lost was below 1e-307 at
// the state where it was lost first. Its posterior probability is therefore at most 1e-307 times the backward
// variable there, at most 1e-147. What FLOOR adds to a posterior probability is at most 1e-140. Both are far
// below MIN_PROBABILITY.
constexpr double FLOOR = 1e-140;
constexpr double MAX_BACKWARD = 1e160;  // relative to the sum of its step
constexpr double MIN_SUM = 1e-300;
constexpr double MIN_PROBABILITY = 1e-120;  // smaller results become zero

}  // namespace

ScaledPass::ScaledPass(const Chain& chain, long max_duration)
    : chain_(chain),
      emissions_(max_duration * chain.width()),
      forward_(emissions_.size()),
      sums_(max_duration) {}

bool ScaledPass::infer(const double* log_emissions, long T, double* smoothed_state_probs,
                       double* transition_counts, double* log_likelihood) {
  if (!forward(log_emissions, T, log_likelihood) || !backward(T, smoothed_state_probs)) return false;
  add_transitions(T, transition_counts);
  return true;
}

bool ScaledPass::forward(const double* log_emissions, long T, double* log_likelihood) {
  const int K = chain_.states(), width = chain_.width();
  double shifts = 0.0;
  for (long t = 0; t < T; ++t) {
    const double most = largest(log_emissions + t * width, width);
    if (!(most > NEVER)) return false;
    shifts += most;
    exponentials(log_emissions + t * width, most, emissions_.data() + t * width, width);
  }
  double* current = forward_.data();
  for (int k = 0; k < width; ++k) current[k] = chain_.initial()[k] * emissions_[k];
  for (long t = 0;; ++t, current += width) {
    sums_[t] = total(current, width);
    if (!(sums_[t] > MIN_SUM)) return false;
    if (t + 1 == T) break;
    product(current, chain_.from(), K, width, current + width);
    // The sum of a step scales the next one; it is computed at the same time as the product.
    const double scale = 1.0 / sums_[t];
    const double* emission = emissions_.data() + (t + 1) * width;
    for (int c = 0; c < width; c += LANES)
      lanes<LANES>(current + width + c) *= lanes<LANES>(emission + c) * scale;
  }
  for (long t = 0; t < T; ++t) shifts += std::log(sums_[t]);
  *log_likelihood = shifts;
  return true;
}

bool ScaledPass::backward(long T, double* smoothed_state_probs) {
  const int K = chain_.states(), width = chain_.width();
  Buffer backward(width, 1.0);
  Lanes<LANES> most = Lanes<LANES>::Zero();
  double largest_error = 0.0;  // of the sum of a step's posterior probabilities, which should be 1
  for (long t = T - 1; t >= 0; --t) {
    if (t + 1 < T) {
      product(emissions_.data() + (t + 1) * width, chain_.into(), K, width, backward.data());
      for (int c = 0; c < width; c += LANES)
        lanes<LANES>(backward.data() + c) = lanes<LANES>(backward.data() + c).max(FLOOR);
    }
    const double scale = 1.0 / sums_[t];
    double *current = forward_.data() + t * width, *gamma = smoothed_state_probs + t * width;
    double* emission = emissions_.data() + t * width;
    for (int c = 0; c < width; c += LANES) {
      const Lanes<LANES> after = lanes<LANES>(backward.data() + c) * scale;
      most = most.max(after);
      lanes<LANES>(emission + c) *= after;
      lanes<LANES>(gamma + c) = lanes<LANES>(current + c) * after;
    }
    const double sum = total(gamma, width), normaliser = 1.0 / sum;
    largest_error = std::max(largest_error, std::abs(sum - 1.0));
    for (int c = 0; c < width; c += LANES) {
      const Lanes<LANES> probability = lanes<LANES>(gamma + c) * normaliser;
      lanes<LANES>(gamma + c) = (probability >= MIN_PROBABILITY).select(probability, 0.0);
      lanes<LANES>(current + c) *= scale * normaliser;
    }
  }
  return most.maxCoeff() <= MAX_BACKWARD && largest_error < 1e-6;
}

// Adds zeta_jk = forward_j a_jk emission_k backward_k, the last two one step later. Four rows of sums at a
// time stay in registers.
void ScaledPass::add_transitions(long T, double* transition_counts) const {
  const int K = chain_.states(), width = chain_.width();
  for (int i = 0; i < K; i += 4)
    for (int c = 0; c < width; c += LANES) {
      Lanes<LANES> rows[4] = {Lanes<LANES>::Zero(), Lanes<LANES>::Zero(), Lanes<LANES>::Zero(),
                              Lanes<LANES>::Zero()};
      const double *before = forward_.data() + i, *after = emissions_.data() + width + c;
      for (long t = 0; t + 1 < T; ++t, before += width, after += width) {
        const Lanes<LANES> next = lanes<LANES>(after);
        rows[0] += before[0] * next, rows[1] += before[1] * next;
        rows[2] += before[2] * next, rows[3] += before[3] * next;
      }
      for (int j = i; j < std::min(i + 4, K); ++j)
        for (int k = c; k < std::min(c + LANES, K); ++k) {
          const double count = chain_.from()[size_t(j) * width + k] * rows[j - i][k - c];
          if (count >= MIN_PROBABILITY) transition_counts[j * K + k] += count;
        }
    }
}

}  // namespace pilotfish
