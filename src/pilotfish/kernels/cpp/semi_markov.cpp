#include "semi_markov.hpp"

#include <algorithm>
#include <cmath>

namespace pilotfish {

namespace {

constexpr double NEGLIGIBLE = -60.0;  // e^-60: a million such terms do not change a sum

// Replaces n terms by their exponentials relative to the largest, which is finite; returns their sum.
double exponential_sum(double* terms, double most, long n) {
  Lanes<LANES> sum = Lanes<LANES>::Zero();
  for (long c = 0; c < n; c += LANES) {
    if (lanes<LANES>(terms + c).maxCoeff() - most < NEGLIGIBLE) {
      lanes<LANES>(terms + c).setZero();
      continue;
    }
    for (long i = c; i < c + LANES; ++i) terms[i] = exponential(terms[i] - most);
    sum += lanes<LANES>(terms + c);
  }
  return sum.sum();
}

// Returns log(e^a + e^b).
double log_add(double a, double b) {
  const double most = std::max(a, b), least = std::min(a, b);
  return least == NEVER ? most : most + std::log1p(std::exp(least - most));
}

// Returns log(e^other + sum over n terms of e^term), where most is the largest term.
double log_sum(double* terms, double most, long n, double other) {
  return most == NEVER ? other : log_add(most + std::log(exponential_sum(terms, most, n)), other);
}

}  // namespace

SemiMarkovInference::SemiMarkovInference(const SemiMarkovChain& chain, long max_duration)
    : chain_(chain),
      lattice_(chain, max_duration),
      starting_(lattice_.emissions.size()),
      ending_(lattice_.emissions.size()),
      remaining_(chain.states()),
      after_(chain.states()),
      transition_counts_(size_t(chain.states()) * chain.states(), 0.0),
      segments_(size_t(4) * chain.states() * chain.stride(), 0.0),
      long_segment_counts_(size_t(2) * chain.states(), 0.0) {}

double SemiMarkovInference::infer(const double* log_emissions, long T, double* smoothed_state_probs) {
  lattice_.read(log_emissions, T);
  forward();
  double log_likelihood = this->log_likelihood();
  if (log_likelihood == NEVER) return NEVER;
  if (lattice_.loses_precision(log_likelihood))
    log_likelihood = log_likelihood_relative_to_best_path(log_emissions, T);
  backward(log_likelihood);
  write(smoothed_state_probs);
  return log_likelihood + lattice_.total_log_offset();
}

void SemiMarkovInference::forward() {
  double* terms = lattice_.terms.data();
  lattice_.forward(
      [&](const Ending& at) { return log_sum(terms, at.most, at.n, at.first); },
      [&](long, int k) { return chain_.origins().log_sum(k, lattice_.state_terms.data(), after_.data()); });
}

double SemiMarkovInference::log_likelihood() {
  double* terms = lattice_.terms.data();
  double log_likelihood = NEVER;
  for (int k = 0; k < chain_.states(); ++k) {
    double most = NEVER;
    lattice_.for_each_last_segment(k, [&](long b, double log_p) {
      terms[b] = log_p;
      most = std::max(most, log_p);
    });
    if (most == NEVER) continue;
    std::fill_n(terms + lattice_.T, LANES, NEVER);
    const double last = most + std::log(exponential_sum(terms, most, lattice_.T));
    log_likelihood = log_add(log_likelihood, last);
  }
  return log_likelihood;
}

void SemiMarkovInference::backward(double log_likelihood) {
  const int K = chain_.states();
  Lattice& in = lattice_;
  std::fill(in.values.begin(), in.values.end(), NEVER);
  std::fill(ending_.begin(), ending_.end(), 0.0);
  std::fill(remaining_.begin(), remaining_.end(), 0.0);
  for (long b = in.T - 1; b >= 0; --b) {
    for (int k = 0; k < K; ++k) after_[k] = backward_step(b, k, log_likelihood);
    if (b == 0) break;
    for (int k = 0; k < K; ++k)
      in.row(in.values, k)[b] = chain_.successors().log_sum(k, after_.data(), in.state_terms.data());
    add_transitions(b);
  }
}

// Returns log p(all later steps | a segment of k begins at b) and adds the expected segments that do. If none
// can, it returns -inf.
double SemiMarkovInference::backward_step(long b, int k, double log_likelihood) {
  Lattice& in = lattice_;
  const bool first = b == 0;
  const long S = chain_.max_duration(), n = std::min(S, in.T - 1 - b);
  const double step = in.row(in.emissions, k)[b], start = in.row(in.starts, k)[b];
  double *expected_starts = in.row(starting_, k) + b, *until = in.row(ending_, k) + b + 1,
         *terms = in.terms.data();
  double most = advance(in.row(in.values, k) + b + 1, step, chain_.segments(first, k), n, terms).term;
  remaining_[k] += step;
  *expected_starts = 0.0;
  if (start == NEVER) return NEVER;
  const double last = remaining_[k] + chain_.last(first, k, in.T - b);
  most = std::max(most, last);
  if (most == NEVER) return NEVER;
  const double last_term = std::exp(last - most), sum = exponential_sum(terms, most, n) + last_term;
  const double log_after = most + std::log(sum);
  *expected_starts = std::exp(start + log_after - log_likelihood);
  if (*expected_starts == 0.0) return log_after;
  const double scale = *expected_starts / sum;
  double* counts = segments(first, k);
  for (long c = 0; c < n; c += LANES) {
    const Lanes<LANES> expected = scale * lanes<LANES>(terms + c);
    lanes<LANES>(counts + c) += expected;
    loose_lanes<LANES>(until + c) += expected;
  }
  const long s = in.T - b;
  (s <= S ? segments(2 + first, k)[s - 1] : long_segment_counts_[first * chain_.states() + k]) += scale * last_term;
  return log_after;
}

// Adds the expected transitions into the segments that begin at b.
void SemiMarkovInference::add_transitions(long b) {
  Lattice& in = lattice_;
  const Neighbours& origins = chain_.origins();
  const int K = chain_.states();
  for (int k = 0; k < K; ++k) {
    const double expected = in.row(starting_, k)[b];
    if (expected == 0.0) continue;
    for (int i = origins.begin[k]; i < origins.begin[k + 1]; ++i) {
      const int j = origins.states[i];
      const double log_fraction =
          in.row(in.ends, j)[b] + origins.log_probabilities[i] - in.row(in.starts, k)[b];
      transition_counts_[size_t(j) * K + k] += expected * std::exp(log_fraction);
    }
  }
}

// Computes state probabilities as segments that have begun less those that have ended, normalised.
void SemiMarkovInference::write(double* smoothed_state_probs) {
  const int K = chain_.states();
  std::fill(after_.begin(), after_.end(), 0.0);
  for (long t = 0; t < lattice_.T; ++t, smoothed_state_probs += K) {
    double sum = 0.0;
    for (int k = 0; k < K; ++k) {
      after_[k] += lattice_.row(starting_, k)[t] - lattice_.row(ending_, k)[t];
      sum += smoothed_state_probs[k] = std::max(after_[k], 0.0);
    }
    for (int k = 0; k < K; ++k) smoothed_state_probs[k] /= sum;
  }
}

void SemiMarkovInference::add_to(double* transition_counts, double* segments, double* long_segment_counts) const {
  const int K = chain_.states();
  const long S = chain_.max_duration();
  for (size_t i = 0; i < transition_counts_.size(); ++i) transition_counts[i] += transition_counts_[i];
  for (size_t i = 0; i < long_segment_counts_.size(); ++i) long_segment_counts[i] += long_segment_counts_[i];
  for (size_t kind = 0; kind < 4; ++kind)
    for (long s = 0; s < S; ++s)
      for (int k = 0; k < K; ++k)
        segments[(kind * S + s) * K + k] += segments_[(kind * K + k) * chain_.stride() + s];
}

void forward(const SemiMarkovChain& chain, const double* log_emissions, long T, double* log_segment_ends,
             double* log_forward) {
  const int K = chain.states();
  const long S = chain.max_duration();
  Lattice lattice(chain, T + 1);
  lattice.read(log_emissions, T);
  lattice.add_silent_step();
  Buffer long_segments(K, NEVER), terms_of_states(K);  // long_segments: later segments of more than S steps
  double log_offsets = 0.0;                            // of all steps but the last
  double* terms = lattice.terms.data();
  const auto log_state_prob = [&](const Ending& at) {
    const long t = at.t, from = t - at.n;
    double *values = lattice.row(lattice.values, at.k), &longer = long_segments[at.k];
    if (from > 1) longer = log_add(longer, values[from - 1]) + at.step;
    const double most =
        advance(values + from, 0.0, chain.last_segments_backwards(at.k, at.n), at.n, terms).term;
    const double last = log_sum(terms, most, at.n, values[0] + chain.last(true, at.k, t));
    return log_add(last, longer + chain.last(false, at.k, S + 1));
  };
  lattice.forward(
      [&](const Ending& at) {
        if (at.k == 0 && at.t > 1) log_offsets += lattice.log_offsets[at.t - 2];
        const double scale = log_offsets + lattice.log_offsets[at.t - 1],
                     end = log_sum(terms, at.most, at.n, at.first);
        log_segment_ends[(at.t - 1) * K + at.k] = end + scale;
        log_forward[(at.t - 1) * K + at.k] = log_state_prob(at) + scale;
        return end;
      },
      [&](long, int k) {
        return chain.origins().log_sum(k, lattice.state_terms.data(), terms_of_states.data());
      });
}

double SemiMarkovInference::log_likelihood_relative_to_best_path(const double* log_emissions, long T) {
  std::vector<int64_t> path(T);
  viterbi(chain_, log_emissions, T, path.data());
  lattice_.read(log_emissions, T, path.data());
  forward();
  return log_likelihood();
}

}  // namespace pilotfish
