#include "scaled_forward_backward.hpp"

#include <algorithm>
#include <cmath>

namespace pilotfish {

namespace {

// What follows from a state is never underestimated: fewer than ten million terms, each of them at most 1e160
// and times an emission lost below 1e-307, lose less than this floor, and a floor is the share of the
// posterior that it adds, at most. So any path that the forward pass lost, at a state that it first lost below
// 1e-307, has a share of at most 1e-307 times what follows from there.
constexpr double FLOOR = 1e-140;
constexpr double MOST_FOLLOWS = 1e160;  // from a state, relative to the sum of its step
constexpr double LEAST_SUM = 1e-300;
constexpr double NOUGHT = 1e-120;  // all that is lost or added is much less

}  // namespace

ScaledPass::ScaledPass(const Chain& chain, long max_duration)
    : chain_(chain), emissions_(max_duration * chain.width()), forward_(emissions_.size()), sums_(max_duration) {}

bool ScaledPass::infer(const double* log_emissions, long T, double* smoothed_state_probs, double* transition_counts,
                       double* log_likelihood) {
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
  double* here = forward_.data();
  for (int k = 0; k < width; ++k) here[k] = chain_.initial()[k] * emissions_[k];
  for (long t = 0;; ++t, here += width) {
    sums_[t] = total(here, width);
    if (!(sums_[t] > LEAST_SUM)) return false;
    if (t + 1 == T) break;
    product(here, chain_.from(), K, width, here + width);
    // The sum of a step divides the next: it is added up while the product is under way.
    const double scale = 1.0 / sums_[t];
    const double* emission = emissions_.data() + (t + 1) * width;
    for (int c = 0; c < width; c += LANES)
      lanes<LANES>(here + width + c) *= lanes<LANES>(emission + c) * scale;
  }
  for (long t = 0; t < T; ++t) shifts += std::log(sums_[t]);
  *log_likelihood = shifts;
  return true;
}

bool ScaledPass::backward(long T, double* smoothed_state_probs) {
  const int K = chain_.states(), width = chain_.width();
  Buffer follows(width, 1.0);
  Lanes<LANES> most = Lanes<LANES>::Zero();
  double furthest = 0.0;  // from one, of a step's posteriors
  for (long t = T - 1; t >= 0; --t) {
    if (t + 1 < T) {
      product(emissions_.data() + (t + 1) * width, chain_.into(), K, width, follows.data());
      for (int c = 0; c < width; c += LANES)
        lanes<LANES>(follows.data() + c) = lanes<LANES>(follows.data() + c).max(FLOOR);
    }
    const double scale = 1.0 / sums_[t];
    double *here = forward_.data() + t * width, *gamma = smoothed_state_probs + t * width;
    double* emission = emissions_.data() + t * width;
    for (int c = 0; c < width; c += LANES) {
      const Lanes<LANES> after = lanes<LANES>(follows.data() + c) * scale;
      most = most.max(after);
      lanes<LANES>(emission + c) *= after;
      lanes<LANES>(gamma + c) = lanes<LANES>(here + c) * after;
    }
    const double sum = total(gamma, width), run_groups = 1.0 / sum;
    furthest = std::max(furthest, std::abs(sum - 1.0));
    for (int c = 0; c < width; c += LANES) {
      const Lanes<LANES> whole = lanes<LANES>(gamma + c) * run_groups;
      lanes<LANES>(gamma + c) = (whole >= NOUGHT).select(whole, 0.0);
      lanes<LANES>(here + c) *= scale * run_groups;
    }
  }
  return most.maxCoeff() <= MOST_FOLLOWS && furthest < 1e-6;
}

// zeta_jk = forward_j a_jk emission_k follows_k, the last two one step later. Four rows of sums at a time stay
// in registers.
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
          if (count >= NOUGHT) transition_counts[j * K + k] += count;
        }
    }
}

}  // namespace pilotfish
