// Scalable online sequence clustering, a datapoint at a time; twins/streaming.py says what is computed.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "lanes.hpp"
#include "subspaces.hpp"

namespace pilotfish {

struct StreamParameters {
  double cluster, dimension, transition, new_transition, bandwidth, merge_distance;
  int weighting;  // 0 counts, 1 traces, 2 constant
  double weight, forget_below;
  int extra_directions, directions;
  long clusters, batch;
};

// The first columns of a cluster's row (StreamColumn), and the head (StreamHead).
enum Number : int { CLUSTER_ID, WEIGHT, POINTS, DEMONSTRATION_STARTS, SEGMENTS, MEAN_DURATION, SQUARED_DEVIATIONS, CENSORED, MEAN_CENSORED_DURATION, NUMBERS };
enum Head : int { CURRENT, STEPS_IN_CLUSTER, NEXT_CLUSTER_ID, POINTS_TOTAL, PREVIOUS, PREVIOUS_STEPS, HEADS };

// Clusters lie as rows of a StreamState, in slots that are used again; order_ is that of their birth, which
// is that of the rows outside. work is memory for updates, which may be kept from stream to stream.
class Stream {
 public:
  Stream(int P, int D, const StreamParameters& parameters, Subspaces& work);

  // K rows, each frame's basis with room for so many directions, as a StreamState has them.
  void load(const double* head, const double* rows, const double* transition_counts, int K, int capacity);
  void store(double* head, double* rows, double* transition_counts, int capacity) const;
  int clusters() const { return int(order_.size()); }
  int capacity() const;  // the most directions that any subspace has, padded

  void observe(const double* x, long N, int64_t* cluster_ids, double* costs, double* changes);
  const std::vector<std::array<int64_t, 3>>& removed() const { return removed_; }

 private:
  struct Choice {
    int slot;  // -1 for a new cluster
    double cost, saved;
  };

  Choice assign(const double* x);
  bool costs_less(const double* x, int slot, double transition, double* best, int* chosen, int place);
  int create(const double* x, long n);
  double follow(int slot);
  double learn(const double* x, int slot);
  void update_weights(int slot, bool fresh);
  void remove_light_clusters(long n);
  void merge_close(int slot, long n);
  int merge(int a, int b, long n);
  void remove(int slot, long n, int64_t into);
  void remove_segment_duration(double* own, double steps) const;
  void pool(double* a, const double* b, int number, int mean, int squares) const;
  int slot_of(int64_t cluster_id) const;

  void reserve_slots(int slots);
  void reserve_room(int capacity);
  void copy_row(const double* from, const Layout& narrow, double* to, const Layout& wide) const;
  const double* logs_of(int slot);
  size_t row() const { return NUMBERS + P_ * layout_.block(); }
  double* numbers(int slot) { return &rows_[size_t(slot) * row()]; }
  const double* numbers(int slot) const { return &rows_[size_t(slot) * row()]; }
  double* transition_counts(int slot) { return &counts_[size_t(slot) * slots_]; }
  double* block(int slot, int p) { return numbers(slot) + NUMBERS + p * layout_.block(); }
  Subspace subspace(int slot, int p) { return layout_.at(block(slot, p)); }

  int P_, D_;
  StreamParameters parameters_;
  Layout layout_;
  Subspaces& subspaces_;
  int slots_ = 0;
  std::vector<int> order_, free_;
  Eigen::VectorXd rows_, logs_;  // row i of logs_: of the counts of slot i, where ready_
  Buffer counts_;
  std::vector<double> totals_;
  std::vector<char> ready_;
  Buffer point_, error_, g_;
  std::vector<char> fresh_;         // of a batch: whether a datapoint began its cluster
  std::vector<int64_t> touched_;    // and the clusters that took some
  int current_ = -1, before_ = -1;  // the cluster visited before, -1 where a demonstration has begun since
  double steps_ = 0.0, next_ = 0.0, seen_ = 0.0, before_steps_ = 0.0;
  std::vector<std::array<int64_t, 3>> removed_;
};

}  // namespace pilotfish
