// Most probable path of a semi-Markov chain.
#include <algorithm>

#include "semi_markov.hpp"

namespace pilotfish {

namespace {

// Best segments that end before each step, and the states before those that begin there.
struct BestSegments {
  BestSegments(int K, long T) : K(K), begins(size_t(K) * T, 0), origins(size_t(K) * T, 0) {}

  int32_t& begin(long t, int k) { return begins[size_t(t) * K + k]; }
  int32_t& origin(long b, int k) { return origins[size_t(b) * K + k]; }

  // Returns whether, of two equally probable segments, the one that begins later, at b, wins a tie.
  bool wins_tie(long b, int k) { return origin(b, k) < k; }

  int K;
  std::vector<int32_t> begins, origins;
};

void find_best_segments(Lattice& lattice, BestSegments& best) {
  lattice.forward(
      [&](const Ending& at) {
        const long from = at.t - at.n;
        long found = at.first >= at.most ? 0 : -1;
        for (long b = at.first > at.most ? at.t : from; b < at.t; ++b)
          if (lattice.terms[b - from] == at.most && (found < 0 || best.wins_tie(b, at.k))) found = b;
        best.begin(at.t, at.k) = int32_t(found);
        return std::max(at.first, at.most);
      },
      [&](long t, int k) {
        const Neighbours& origins = lattice.chain.origins();
        double most = NEVER;
        for (int i = origins.begin[k]; i < origins.begin[k + 1]; ++i) {
          const double log_p = lattice.state_terms[origins.states[i]] + origins.log_probabilities[i];
          if (log_p > most) {  // the first of equal ones
            most = log_p;
            best.origin(t, k) = origins.states[i];
          }
        }
        return most;
      });
}

// Writes the most probable path of the lattice; returns its log-probability, relative to the offsets.
double best_path(Lattice& lattice, int64_t* states) {
  const int K = lattice.chain.states();
  const long T = lattice.T;
  BestSegments best(K, T);
  find_best_segments(lattice, best);
  double most = NEVER;
  long begin = 0;
  int state = 0;
  for (int k = 0; k < K; ++k) {
    lattice.for_each_last_segment(k, [&](long b, double log_p) {
      if (log_p > most || (log_p == most && k == state && !best.wins_tie(begin, k))) {
        most = log_p;
        begin = b;
        state = k;
      }
    });
  }
  if (most == NEVER) begin = 0;
  for (long end = T; end > 0; end = begin, begin = end > 0 ? best.begin(end, state) : 0) {
    std::fill(states + begin, states + end, state);
    if (begin > 0) state = best.origin(begin, state);
  }
  return most;
}

}  // namespace

double viterbi(const SemiMarkovChain& chain, const double* log_emissions, long T, int64_t* states) {
  Lattice lattice(chain, T);
  lattice.read(log_emissions, T);
  double most = best_path(lattice, states);
  if (most != NEVER && lattice.loses_precision(most)) {
    lattice.read(log_emissions, T, states);
    most = best_path(lattice, states);
  }
  return most + lattice.total_log_offset();
}

}  // namespace pilotfish
