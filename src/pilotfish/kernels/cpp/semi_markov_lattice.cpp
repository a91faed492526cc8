#include "semi_markov_lattice.hpp"

#include <algorithm>

namespace pilotfish {

namespace {

// A larger decrease of the best partial path costs the surviving paths digits: 2e-16 of it, in nats.
constexpr double MAX_DROP = 1e6;

// Returns the padded size of a row: whole registers are read and written beyond its end.
long padded(long n) { return (n + LANES - 1) / LANES * LANES + LANES; }

}  // namespace

Largest advance(double* values, double step, const double* weights, long n, double* terms) {
  Lanes<LANES> most = Lanes<LANES>::Constant(NEVER), best = most;
  for (long c = 0; c < n; c += LANES) {
    const Lanes<LANES> value = loose_lanes<LANES>(values + c) + step;
    const Lanes<LANES> term = value + loose_lanes<LANES>(weights + c);
    loose_lanes<LANES>(values + c) = value;
    lanes<LANES>(terms + c) = term;
    best = best.max(value);
    most = most.max(term);
  }
  return {best.maxCoeff(), most.maxCoeff()};
}

SemiMarkovChain::SemiMarkovChain(SemiMarkovTables tables)
    : K_(tables.K),
      S_(tables.S),
      stride_(padded(tables.S)),
      log_initial_(tables.log_initial, tables.log_initial + tables.K),
      log_tail_weights_(tables.log_tail_weights, tables.log_tail_weights + 2 * tables.K),
      tables_(size_t(4) * K_ * stride_, NEVER),
      reversed_(size_t(2) * K_ * stride_, NEVER),
      max_duration_(size_t(2) * K_, 0),
      successors_(tables.log_transitions, K_, false),
      origins_(tables.log_transitions, K_, true) {
  for (size_t kind = 0; kind < 4; ++kind)
    for (long s = 0; s < S_; ++s)
      for (int k = 0; k < K_; ++k)
        tables_[(kind * K_ + k) * stride_ + s] = tables.log_segment_weights[(kind * S_ + s) * K_ + k];
  for (int kind : {0, 2})
    for (int k = 0; k < K_; ++k)
      std::reverse_copy(at(kind, k), at(kind, k) + S_, reversed_.data() + (kind / 2 * K_ + k) * stride_);
  for (bool first : {false, true})
    for (int k = 0; k < K_; ++k) {
      long& max_duration = max_duration_[first * K_ + k] = S_;
      if (may_exceed_tables(first, k)) continue;
      while (max_duration > 0 && at(first, k)[max_duration - 1] == NEVER &&
             at(2 + first, k)[max_duration - 1] == NEVER)
        --max_duration;
    }
}

Lattice::Lattice(const SemiMarkovChain& chain, long max_duration)
    : chain(chain),
      capacity(padded(max_duration)),
      log_offsets(capacity),
      emissions(size_t(chain.states()) * capacity),
      starts(emissions.size()),
      ends(emissions.size()),
      values(emissions.size()),
      longer(chain.states()),
      terms(capacity),
      state_terms(chain.states()) {}

void Lattice::read(const double* log_emissions, long steps) {
  const int K = chain.states();
  T = steps;
  for (long t = 0; t < T; ++t, log_emissions += K) {
    const double best = *std::max_element(log_emissions, log_emissions + K);
    log_offsets[t] = best == NEVER ? 0.0 : best;
    for (int k = 0; k < K; ++k) row(emissions, k)[t] = log_emissions[k] - log_offsets[t];
  }
  relative_to_path = false;
}

void Lattice::read(const double* log_emissions, long steps, const int64_t* path) {
  const int K = chain.states();
  T = steps;
  for (long t = 0; t < T; ++t, log_emissions += K) {
    log_offsets[t] = log_emissions[path[t]];
    for (int k = 0; k < K; ++k) row(emissions, k)[t] = log_emissions[k] - log_offsets[t];
  }
  relative_to_path = true;
}

bool Lattice::loses_precision(double log_likelihood) const {
  return !relative_to_path && std::max(largest_drop, -log_likelihood) > MAX_DROP;
}

void Lattice::add_silent_step() {
  for (int k = 0; k < chain.states(); ++k) row(emissions, k)[T] = 0.0;
  log_offsets[T++] = 0.0;
}

double Lattice::best_running(long t, int k, double most) const {
  if (chain.may_exceed_tables(false, k)) most = std::max(most, longer[k]);
  const bool continues = t < chain.max_duration(true, k) || chain.may_exceed_tables(true, k);
  return continues ? std::max(most, row(values, k)[0]) : most;
}

double Lattice::subtract_offset(long t, double best) {
  if (best == NEVER || relative_to_path) return 0.0;
  const int K = chain.states();
  largest_drop = std::max(largest_drop, -best);
  for (int k = 0; k < K; ++k) {
    row(starts, k)[t] -= best;
    row(ends, k)[t] -= best;
    row(emissions, k)[t - 1] -= best;
  }
  log_offsets[t - 1] += best;
  return best;
}

double Lattice::total_log_offset() const {
  double sum = 0.0;
  for (long t = 0; t < T; ++t) sum += log_offsets[t];
  return sum;
}

}  // namespace pilotfish
