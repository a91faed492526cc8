// Inference along a semi-Markov chain, in logarithms; the NumPy reference defines every name.
//
// Reference points. Log-probabilities of a recording reach +-1e20 where states are sharp, while those of the
// paths that matter differ by a few nats: whatever is added up must be relative to something close to these
// paths, or their differences are lost to rounding.
//
//   1. Every step is relative to its best emission, and to the best partial path until there: one that is about
//      to enter a state, or one that stays in a visit that can still go on. A running visit counts, since near
//      the end of a recording all mass may lie in a last visit, and whatever could start beside it is 1e13 nats
//      less likely. A visit that can neither end nor be the last does not count.
//   2. Where the best partial path is a dead end - an outlier that one state explains, which then cannot be
//      left - the paths that survive are far below it. This shows as a drop of the best partial path beyond
//      LARGEST_DROP. Then every step is relative to the emission of the best whole path (Viterbi) instead. At
//      the nodes of that path and of those close to it, no partial path is better than its own: two paths into
//      one node have the same future.
#pragma once

#include "markov.hpp"

namespace pilotfish {

// K states and tables of S steps, C-contiguous; see SemiMarkovTables in arguments.py.
struct SemiMarkovTables {
  int K;
  long S;
  const double *log_initial, *log_transitions, *log_segment_weights, *log_tail_weights;
};

// The tables laid out so that lengths of visits lie side by side, and how states follow each other.
class SemiMarkovChain {
 public:
  explicit SemiMarkovChain(SemiMarkovTables tables);

  int states() const { return K_; }
  long width() const { return K_; }  // of log-emissions and posteriors
  long max_duration() const { return S_; }

  // The longest possible visit to a state of at most S steps, by whether it began with the recording; S where
  // longer ones may be the last.
  long max_duration(bool first, int state) const { return max_duration_[first * K_ + state]; }
  bool may_exceed_tables(bool first, int state) const { return log_tail_weights_[first * K_ + state] != NEVER; }
  long stride() const { return stride_; }
  double log_initial(int state) const { return log_initial_[state]; }
  const Neighbours& successors() const { return successors_; }
  const Neighbours& origins() const { return origins_; }

  // weights[s - 1] of visits that another follows, by whether they began with the recording.
  const double* segments(bool first, int state) const { return at(first, state); }

  // The same of those that began inside it, from the longest, n steps, down to one.
  const double* segments_backwards(int state, long n) const {
    return reversed_.data() + state * stride_ + (S_ - n);
  }

  // Those that began inside it and last until it ends, likewise.
  const double* last_segments_backwards(int state, long n) const {
    return reversed_.data() + (K_ + state) * stride_ + (S_ - n);
  }

  // The weight of the last visit, s steps of which were recorded, by whether it is the first as well.
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
  Buffer tables_;    // (4, K, stride), padded with impossible lengths
  Buffer reversed_;  // (2, K, stride), those of kinds 0 and 2
  std::vector<long> max_duration_;  // (2, K)
  Neighbours successors_, origins_;
};

// Visits to k that may end with step t: n of them that began inside the recording lie ready in terms, the
// earliest first, and one began with it. step is the emission that they all had last, less what was taken
// out.
struct Ending {
  long t;
  int k;
  long n;
  double step, most, first;  // most is the largest of the terms
};

// Where visits may begin and end within one demonstration of T steps. Rows are those of states, of room
// entries. What is taken out of every step keeps numbers small, however long the demonstration: see above.
struct Lattice {
  Lattice(const SemiMarkovChain& chain, long max_duration);

  // Takes the best emission out of every step, and `forward` the best partial path.
  void read(const double* log_emissions, long T);

  // Takes the emission of a path out of every step, and nothing else.
  void read(const double* log_emissions, long T, const int64_t* path);

  // Whether the best partial path dropped so far that the surviving paths have lost digits.
  bool loses_precision(double log_likelihood) const;

  // One more, that says nothing: what ends with the last one is asked for as well.
  void add_silent_step();

  // end(Ending): ends[k, t] from what lies ready in terms and values. start(t, k): starts[k, t] from few.
  template <typename End, typename Start>
  void forward(End end, Start start);

  // The best running visit to k at step t, relative as values are; most is that of visits from the tables.
  double best_running(long t, int k, double most) const;
  double subtract_offset(long t, double best);

  // visit(b, log p(all steps, this is the last visit)) for every visit to k, from the latest to the first.
  template <typename Visit>
  void for_each_last_visit(int k, Visit visit) const;

  double* row(Buffer& rows, int k) { return rows.data() + k * capacity; }
  const double* row(const Buffer& rows, int k) const { return rows.data() + k * capacity; }
  double total_log_offset() const;

  const SemiMarkovChain& chain;
  long capacity, T = 0;
  bool relative_to_path = false;
  double largest_drop = 0.0;  // of the best partial path, in one step
  Buffer log_offsets;               // (room)
  Buffer emissions;     // (K, room), less what was taken out
  Buffer starts, ends;  // (K, room), as the twin's, less what was taken out until there
  Buffer values;        // (K, room), of every start or end: it, and the emissions on the way
  Buffer longer;        // (K), the best of the values of visits that are longer than the tables
  Buffer terms, few;    // room to work in, of a visit's steps and of the states
};

// Infers demonstrations one at a time, and adds up what is expected of all of them.
class SemiMarkovInference {
 public:
  // Room for demonstrations of up to `longest` steps.
  SemiMarkovInference(const SemiMarkovChain& chain, long max_duration);

  // posteriors (T, K) from log_emissions (T, K). Returns log p(all steps); at -inf nothing is added, and
  // posteriors are as they were.
  double infer(const double* log_emissions, long T, double* smoothed_state_probs);

  // Adds what was expected of all demonstrations: transitions (K, K), visits (4, S, K), beyond (2, K).
  void add_to(double* transitions, double* segments, double* tail_counts) const;

 private:
  void forward();
  double log_likelihood();
  double log_likelihood_beside_best_path(const double* log_emissions, long T);
  void backward(double log_likelihood);
  double backward_step(long b, int k, double log_likelihood);
  void add_transitions(long b);
  void write(double* smoothed_state_probs);
  double* transition_counts(int kind, int k) {
    return segments_.data() + (size_t(kind) * chain_.states() + k) * chain_.stride();
  }

  const SemiMarkovChain& chain_;
  Lattice lattice_;
  Buffer starting_, ending_;               // (K, room), expected visits that begin after b, that end with t
  Buffer remaining_, after_;              // (K), emissions until the end; log p(them | a visit begins)
  Buffer transitions_, segments_, tail_counts_;  // (K, K), (4, K, stride), (2, K): sums over demonstrations
};

// log_ends and log_occupancy (T, K), of every step what a recording that ends with it would say.
void forward(const SemiMarkovChain& chain, const double* log_emissions, long T, double* log_segment_ends,
             double* log_forward);

// The most probable path into states (T); returns its log-probability.
double viterbi(const SemiMarkovChain& chain, const double* log_emissions, long T, int64_t* states);

}  // namespace pilotfish
