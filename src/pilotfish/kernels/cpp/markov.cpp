#include "markov.hpp"

#include <algorithm>
#include <cmath>

namespace pilotfish {

namespace {

// A larger decrease of the best partial path costs the surviving paths digits: 2e-16 of it, in nats.
constexpr double MAX_DROP = 1e6;

constexpr double UNDERFLOW_RISK = 1e-280;  // a smaller sum may have lost a term to underflow, at 1e-308

int padded(int K) { return (K + LANES - 1) / LANES * LANES; }

// Returns a (K, width) copy of a (K, K) matrix or its transpose, padded with ones so that no sum is small.
Buffer pad(const double* matrix, int K, bool transposed) {
  const int width = padded(K);
  Buffer rows(size_t(K) * width, 1.0);
  for (int j = 0; j < K; ++j)
    for (int k = 0; k < K; ++k)
      rows[size_t(j) * width + k] = transposed ? matrix[k * K + j] : matrix[j * K + k];
  return rows;
}

// Returns the largest log-emission of a step, or zero if all are -inf.
double step_best(const double* log_emissions, int width) {
  const double best = *std::max_element(log_emissions, log_emissions + width);
  return best == NEVER ? 0.0 : best;
}

}  // namespace

// Two partial sums, so that additions overlap.
void product(const double* weight, const double* rows, int K, int width, double* sum) {
  for (int c = 0; c < width; c += LANES, rows += LANES, sum += LANES) {
    Lanes<LANES> even = weight[0] * lanes<LANES>(rows), odd = Lanes<LANES>::Zero();
    int j = 1;
    for (; j + 1 < K; j += 2) {
      odd += weight[j] * lanes<LANES>(rows + j * width);
      even += weight[j + 1] * lanes<LANES>(rows + (j + 1) * width);
    }
    if (j < K) odd += weight[j] * lanes<LANES>(rows + j * width);
    lanes<LANES>(sum) = even + odd;
  }
}

Neighbours::Neighbours(const double* log_transitions, int K, bool transposed) : begin{0} {
  for (int j = 0; j < K; ++j) {
    for (int k = 0; k < K; ++k) {
      const double log_probability = log_transitions[transposed ? k * K + j : j * K + k];
      if (log_probability == NEVER) continue;
      states.push_back(k);
      log_probabilities.push_back(log_probability);
    }
    begin.push_back(int(states.size()));
  }
}

double Neighbours::log_sum(int state, const double* values, double* terms) const {
  const int first = begin[state], count = begin[state + 1] - first;
  double most = NEVER, sum = 0.0;
  for (int i = 0; i < count; ++i) {
    terms[i] = values[states[first + i]] + log_probabilities[first + i];
    most = std::max(most, terms[i]);
  }
  if (most == NEVER) return NEVER;
  for (int i = 0; i < count; ++i) terms[i] = exponential(terms[i] - most);
  for (int i = 0; i < count; ++i) sum += terms[i];
  return most + std::log(sum);
}

Chain::Chain(int K, const double* log_initial, const double* transitions, const double* log_transitions)
    : K_(K),
      width_(padded(K)),
      log_transitions_(log_transitions),
      log_initial_(size_t(width_), NEVER),
      initial_(size_t(width_)),
      from_(pad(transitions, K, false)),
      into_(pad(transitions, K, true)),
      successors_(log_transitions, K, false),
      origins_(log_transitions, K, true) {
  std::copy_n(log_initial, K, log_initial_.begin());
  exponentials(log_initial_.data(), 0.0, initial_.data(), width_);
}

double Chain::forward(const double* log_emissions, long T, double* forward, double* offsets,
                      double* drop) const {
  Buffer likelihood(width_), sum(width_), terms(width_);
  double best = step_best(log_emissions, width_);
  for (int k = 0; k < width_; ++k) forward[k] = log_initial_[k] + (log_emissions[k] - best);
  offsets[0] = best;
  *drop = 0.0;
  for (long t = 0;; ++t, forward += width_) {
    const double most = largest(forward, width_);
    *drop = std::max(*drop, -most);
    if (most == NEVER) {
      std::fill_n(forward, (T - t) * width_, NEVER);
      std::fill_n(offsets + t, T - t, 0.0);
      return NEVER;
    }
    exponentials(forward, most, likelihood.data(), width_);
    if (t + 1 == T) return offsets[t] + most + std::log(total(likelihood.data(), width_));
    product(likelihood.data(), from_.data(), K_, width_, sum.data());
    double* next = forward + width_;
    logarithms(sum.data(), next, width_);
    if (smallest(sum.data(), width_) < UNDERFLOW_RISK) {
      for (int k = 0; k < K_; ++k)
        if (sum[k] < UNDERFLOW_RISK) next[k] = origins_.log_sum(k, forward, terms.data()) - most;
    }
    log_emissions += width_;
    best = step_best(log_emissions, width_);
    for (int k = 0; k < width_; ++k) next[k] += log_emissions[k] - best;
    offsets[t + 1] = offsets[t] + most + best;
  }
}

// Work memory of the step from t + 1 back to t.
struct Chain::Step {
  explicit Step(int K, int width)
      : ahead(width), likelihood(width), sum(width), terms(width), ratios(size_t(K) * width), exact(ratios) {}
  Buffer ahead;       // log p(step t + 1 and all later | state at t + 1), relative
  Buffer likelihood;  // exp of it, relative to the largest
  Buffer sum;         // sum over k of a_jk likelihood_k
  Buffer terms;       // scratch
  Buffer ratios;      // sum over t of gamma_j likelihood_k / sum_j: times a_jk, the expected transitions
  Buffer exact;       // sum over t of expected transitions of rows whose sum was small
};

void Chain::backward(const double* log_emissions, long T, double* forward, double* transition_counts,
                     double drop) const {
  if (drop > MAX_DROP) return relative_to_best_path(log_emissions, T, forward, transition_counts);
  Step step(K_, width_);
  Buffer later(width_, 0.0), joint(width_);  // later: log p(all later steps | state), relative
  for (long t = T - 1; t >= 0; --t) {
    if (t + 1 < T) {
      const double* emission = log_emissions + (t + 1) * width_;
      const double best = step_best(emission, width_);
      for (int k = 0; k < width_; ++k) step.ahead[k] = (emission[k] - best) + later[k];
      backward_step(step, later.data());
    }
    double* gamma = forward + t * width_;
    for (int k = 0; k < width_; ++k) joint[k] = gamma[k] + later[k];
    exponentials(joint.data(), largest(joint.data(), width_), gamma, width_);
    const double scale = 1.0 / total(gamma, width_);
    for (int k = 0; k < width_; ++k) gamma[k] *= scale;
    if (t + 1 < T) add_transitions(step, gamma);
  }
  for (int j = 0; j < K_; ++j)
    for (int k = 0; k < K_; ++k) {
      const size_t at = size_t(j) * width_ + k;
      transition_counts[j * K_ + k] += from_[at] * step.ratios[at] + step.exact[at];
    }
}

void Chain::backward_step(Step& step, double* later) const {
  const double most = largest(step.ahead.data(), width_);
  exponentials(step.ahead.data(), most, step.likelihood.data(), width_);
  product(step.likelihood.data(), into_.data(), K_, width_, step.sum.data());
  logarithms(step.sum.data(), later, width_);
  if (smallest(step.sum.data(), width_) >= UNDERFLOW_RISK) return;
  for (int j = 0; j < K_; ++j)
    if (step.sum[j] < UNDERFLOW_RISK)
      later[j] = successors_.log_sum(j, step.ahead.data(), step.terms.data()) - most;
}

// Adds zeta_jk = gamma_j a_jk likelihood_k / sum_j.
void Chain::add_transitions(Step& step, const double* gamma) const {
  for (int j = 0; j < K_; ++j) {
    if (gamma[j] == 0.0) continue;
    double* ratios = step.ratios.data() + size_t(j) * width_;
    if (step.sum[j] >= UNDERFLOW_RISK) {
      const double ratio = gamma[j] / step.sum[j];
      for (int c = 0; c < width_; c += LANES)
        lanes<LANES>(ratios + c) += ratio * lanes<LANES>(step.likelihood.data() + c);
    } else {
      double* exact = step.exact.data() + size_t(j) * width_;
      const double log_sum = successors_.log_sum(j, step.ahead.data(), step.terms.data());
      for (int i = successors_.begin[j]; i < successors_.begin[j + 1]; ++i) {
        const int k = successors_.states[i];
        exact[k] += gamma[j] * std::exp(step.ahead[k] + successors_.log_probabilities[i] - log_sum);
      }
    }
  }
}

// Forward-backward in logarithms throughout, from emissions relative to those of the most probable path. It
// fills forward (T, width) again, without offsets: the best partial path may be far above the likely paths.
void Chain::relative_to_best_path(const double* log_emissions, long T, double* forward,
                                  double* transition_counts) const {
  std::vector<int64_t> path(T);
  viterbi(K_, T, log_emissions, width_, log_initial_.data(), log_transitions_, path.data());
  Buffer emissions(T * width_, NEVER), terms(width_), later(width_, 0.0), ahead(width_, NEVER);
  for (long t = 0; t < T; ++t)
    for (int k = 0; k < K_; ++k)
      emissions[t * width_ + k] = log_emissions[t * width_ + k] - log_emissions[t * width_ + path[t]];
  std::fill_n(forward, T * width_, NEVER);
  for (int k = 0; k < K_; ++k) forward[k] = log_initial_[k] + emissions[k];
  for (long t = 1; t < T; ++t)
    for (int k = 0; k < K_; ++k)
      forward[t * width_ + k] =
          origins_.log_sum(k, forward + (t - 1) * width_, terms.data()) + emissions[t * width_ + k];
  for (long t = T - 1; t >= 0; --t) {
    double* gamma = forward + t * width_;
    if (t + 1 < T)
      for (int j = 0; j < K_; ++j) later[j] = successors_.log_sum(j, ahead.data(), terms.data());
    double most = NEVER, sum = 0.0;
    for (int k = 0; k < K_; ++k) most = std::max(most, gamma[k] += later[k]);
    for (int k = 0; k < width_; ++k) sum += gamma[k] = std::exp(gamma[k] - most);
    for (int k = 0; k < width_; ++k) gamma[k] /= sum;
    if (t + 1 < T)
      for (int j = 0; j < K_; ++j)
        for (int i = successors_.begin[j]; gamma[j] > 0.0 && i < successors_.begin[j + 1]; ++i) {
          const int k = successors_.states[i];
          transition_counts[j * K_ + k] +=
              gamma[j] * std::exp(ahead[k] + successors_.log_probabilities[i] - later[j]);
        }
    for (int k = 0; k < K_; ++k) ahead[k] = emissions[t * width_ + k] + later[k];
  }
}

double forward_backward(const Chain& chain, const double* log_emissions, long T, double* smoothed_state_probs,
                        double* transition_counts, double* log_forward) {
  const long K = chain.states(), width = chain.width();
  Buffer padded(T * width, NEVER), gamma(T * width), offsets(T);
  for (long t = 0; t < T; ++t) std::copy_n(log_emissions + t * K, K, padded.data() + t * width);
  double drop;
  const double log_likelihood = chain.forward(padded.data(), T, gamma.data(), offsets.data(), &drop);
  for (long t = 0; t < T; ++t)
    for (long k = 0; k < K; ++k) log_forward[t * K + k] = gamma[t * width + k] + offsets[t];
  std::fill_n(smoothed_state_probs, T * K, 0.0);
  std::fill_n(transition_counts, K * K, 0.0);
  if (log_likelihood == NEVER) return NEVER;
  chain.backward(padded.data(), T, gamma.data(), transition_counts, drop);
  for (long t = 0; t < T; ++t) std::copy_n(gamma.data() + t * width, K, smoothed_state_probs + t * K);
  return log_likelihood;
}

namespace {

// Viterbi recursion, from emissions less the offset of each step.
double best_path(int K, long T, const double* log_emissions, long stride,
                 const std::vector<double>& log_offsets, const double* log_initial,
                 const double* log_transitions, int64_t* states) {
  std::vector<double> best(K), score(K), origin(K);  // origins as doubles: the same vector width
  std::vector<int32_t> origins(size_t(T) * K);
  for (int k = 0; k < K; ++k) best[k] = log_initial[k] + (log_emissions[k] - log_offsets[0]);
  for (long t = 1; t < T; ++t) {
    const double* emission = log_emissions + t * stride;
    for (int k = 0; k < K; ++k) score[k] = best[0] + log_transitions[k];
    std::fill(origin.begin(), origin.end(), 0.0);
    for (int j = 1; j < K; ++j)
      for (int k = 0; k < K; ++k) {
        const double candidate = best[j] + log_transitions[j * K + k];
        const bool better = candidate > score[k];
        score[k] = better ? candidate : score[k];
        origin[k] = better ? double(j) : origin[k];
      }
    for (int k = 0; k < K; ++k) {
      best[k] = score[k] + (emission[k] - log_offsets[t]);
      origins[t * K + k] = int32_t(origin[k]);
    }
  }
  states[T - 1] = std::max_element(best.begin(), best.end()) - best.begin();  // the first of equal ones
  for (long t = T - 1; t > 0; --t) states[t - 1] = origins[t * K + states[t]];
  return best[states[T - 1]];
}

}  // namespace

double viterbi(int K, long T, const double* log_emissions, long stride, const double* log_initial,
               const double* log_transitions, int64_t* states) {
  std::vector<double> log_offsets(T);
  for (long t = 0; t < T; ++t) log_offsets[t] = step_best(log_emissions + t * stride, K);
  double best = best_path(K, T, log_emissions, stride, log_offsets, log_initial, log_transitions, states);
  if (best < -MAX_DROP && best != NEVER) {  // rounding may hide which of two paths is more probable
    for (long t = 0; t < T; ++t) log_offsets[t] = log_emissions[t * stride + states[t]];
    best = best_path(K, T, log_emissions, stride, log_offsets, log_initial, log_transitions, states);
  }
  for (double offset : log_offsets) best += offset;
  return best;
}

}  // namespace pilotfish
