// Semi-Markov chain and its forward recursion, for forward-backward and Viterbi, in logarithms.
// kernels/reference/semi_markov.py derives the recursions and defines starts, ends, after_starts and the four
// kinds of segments; names are the same.
//
// Offsets. Log-probabilities reach 1e20 in magnitude if states are narrow, while those of the likely paths
// differ by a few nats. All sums must therefore be relative to a path close to the likely ones.
//
//   1. Every step is relative to its largest emission, and to the best partial path so far. A partial path
//   either is
//      about to enter a state or stays in a segment that can continue. Running segments count: near the end
//      of a recording, all probability may lie in the last segment, and a new segment may be 1e13 nats less
//      likely. A segment that can neither end nor be the last does not count.
//   2. If the best partial path is a dead end (an outlier that only one state explains, which then cannot be
//   left),
//      the surviving paths are far below it. This shows as a decrease of the best partial path by more than
//      MAX_DROP. Then every step is relative to the emission of the most probable whole path (Viterbi). At
//      the nodes of that path and of those close to it, no partial path is better than its own: two paths
//      into one node have the same future.
//
// Invariant: offsets of steps are the same for all states, so that they cancel in probabilities and add up in
// the likelihood. Keep in step with the NumPy reference: segment terms, last-segment terms and ties of
// Viterbi.
#pragma once

#include "markov.hpp"

namespace pilotfish {

// Tables of S steps for K states, C-contiguous; see SemiMarkovTables in arguments.py.
struct SemiMarkovTables {
  int K;
  long S;
  const double *log_initial, *log_transitions, *log_segment_weights, *log_tail_weights;
};

// Chain with tables in which durations are adjacent in memory, and sparse transitions.
class SemiMarkovChain {
 public:
  explicit SemiMarkovChain(SemiMarkovTables tables);

  int states() const { return K_; }
  long width() const { return K_; }  // of log-emissions and state probabilities
  long max_duration() const { return S_; }

  // Returns the longest possible duration in the tables, for first or later segments; S if the last segment
  // may be longer than the tables.
  long max_duration(bool first, int state) const { return max_duration_[first * K_ + state]; }
  bool may_exceed_tables(bool first, int state) const {
    return log_tail_weights_[first * K_ + state] != NEVER;
  }
  long stride() const { return stride_; }
  double log_initial(int state) const { return log_initial_[state]; }
  const Neighbours& successors() const { return successors_; }
  const Neighbours& origins() const { return origins_; }

  // Returns weights[s - 1] of kind 0, or of kind 1 if first.
  const double* segments(bool first, int state) const { return at(first, state); }

  // Returns weights of kind 0 in reverse order, from n steps down to one.
  const double* segments_backwards(int state, long n) const {
    return reversed_.data() + state * stride_ + (S_ - n);
  }

  // Returns weights of kind 2 in reverse order, from n steps down to one.
  const double* last_segments_backwards(int state, long n) const {
    return reversed_.data() + (K_ + state) * stride_ + (S_ - n);
  }

  // Returns the weight of a last segment of s recorded steps: kind 2, or kind 3 if first.
  double last(bool first, int state, long s) const {
    return s <= S_ ? at(2 + first, state)[s - 1] : log_tail_weights_[first * K_ + state];
  }

 private:
  const double* at(int kind, int state) const {
    return tables_.data() + (size_t(kind) * K_ + state) * stride_;
  }

  int K_;
  long S_, stride_;
  Buffer log_initial_, log_tail_weights_;
  Buffer tables_;                   // (4, K, stride), padded with impossible durations
  Buffer reversed_;                 // (2, K, stride), kinds 0 and 2
  std::vector<long> max_duration_;  // (2, K)
  Neighbours successors_, origins_;
};

// Segments of k that may end before step t: the terms of n segments that began inside the recording, the
// earliest first, and the term `first` of the one that began with it. step is their last emission, less the
// offset.
struct Ending {
  long t;
  int k;
  long n;
  double step, most, first;  // most: the largest of the terms
};

// Forward variables of one demonstration of T steps, relative to offsets: see above. Rows belong to states
// and have `capacity` entries.
struct Lattice {
  Lattice(const SemiMarkovChain& chain, long max_duration);

  // Reads emissions relative to the largest of each step; `forward` then subtracts the best partial path.
  void read(const double* log_emissions, long T);

  // Reads emissions relative to those of a path; `forward` then subtracts nothing.
  void read(const double* log_emissions, long T, const int64_t* path);

  // Returns whether the best partial path decreased so much that the surviving paths have lost digits.
  bool loses_precision(double log_likelihood) const;

  // Appends a step with emissions of one, so that segments may also end with the last step.
  void add_silent_step();

  // Runs the forward recursion. end(Ending) returns ends[k, t] from terms and values; start(t, k) returns
  // starts[k, t] from the ends in state_terms.
  template <typename End, typename Start>
  void forward(End end, Start start);

  // Returns the best running segment of k at step t; most is the best of those within the tables.
  double best_running(long t, int k, double most) const;
  double subtract_offset(long t, double best);

  // Calls visit(b, log p(all steps, the last segment is of k and begins at b)), from the latest b to 0.
  template <typename Visit>
  void for_each_last_segment(int k, Visit visit) const;

  double* row(Buffer& rows, int k) { return rows.data() + k * capacity; }
  const double* row(const Buffer& rows, int k) const { return rows.data() + k * capacity; }
  double total_log_offset() const;

  const SemiMarkovChain& chain;
  long capacity, T = 0;
  bool relative_to_path = false;
  double largest_drop = 0.0;  // largest decrease of the best partial path in one step
  Buffer log_offsets;         // (capacity)
  Buffer emissions;           // (K, capacity), less the offsets
  Buffer starts, ends;        // (K, capacity), less the sum of offsets so far
  Buffer values;              // (K, capacity), starts or after_ends plus the emissions since then
  Buffer longer;              // (K), largest value of segments longer than the tables
  Buffer terms, state_terms;  // scratch: durations of a segment, states
};

struct Largest {
  double value, term;
};

// Adds step to n values, and writes value + weight to terms. Returns the largest value and term.
Largest advance(double* values, double step, const double* weights, long n, double* terms);

template <typename End, typename Start>
void Lattice::forward(End end, Start start) {
  const int K = chain.states();
  std::fill(values.begin(), values.end(), NEVER);
  std::fill(longer.begin(), longer.end(), NEVER);
  largest_drop = 0.0;
  for (int k = 0; k < K; ++k) {
    row(values, k)[0] = row(starts, k)[0] = chain.log_initial(k);
    row(ends, k)[0] = NEVER;
  }
  double pending_offset = 0.0;  // offset of the previous step, not yet subtracted from values
  for (long t = 1; t < T; ++t) {
    double best = NEVER;
    for (int k = 0; k < K; ++k) {
      const long from = std::max<long>(1, t - chain.max_duration(false, k)), n = t - from;
      const double step = row(emissions, k)[t - 1] - pending_offset;
      double* value = row(values, k);
      const Largest most = advance(value + from, step, chain.segments_backwards(k, n), n, terms.data());
      value[0] += step;
      if (from > 1) longer[k] = std::max(longer[k], value[from - 1]) + step;
      best = std::max(best, best_running(t, k, most.value));
      const double first = t <= chain.max_duration() ? value[0] + chain.segments(true, k)[t - 1] : NEVER;
      state_terms[k] = row(ends, k)[t] = end(Ending{t, k, n, step, most.term, first});
    }
    for (int k = 0; k < K; ++k) best = std::max(best, row(values, k)[t] = row(starts, k)[t] = start(t, k));
    pending_offset = subtract_offset(t, best);
  }
}

template <typename Visit>
void Lattice::for_each_last_segment(int k, Visit visit) const {
  double remaining = 0.0;
  for (long b = T - 1; b >= 0; --b) {
    remaining += row(emissions, k)[b];
    visit(b, row(starts, k)[b] + remaining + chain.last(b == 0, k, T - b));
  }
}

}  // namespace pilotfish
