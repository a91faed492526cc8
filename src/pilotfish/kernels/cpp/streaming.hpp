// Scalable online sequence clustering (SOSC), one datapoint at a time. Defined by
// kernels/reference/streaming.py, which heads the algorithm; the layout of a row is in
// kernels/stream_state.py.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "lanes.hpp"
#include "subspaces.hpp"

namespace pilotfish {

// Parameters in the order of StreamParameters in kernels/stream_state.py.
struct StreamParameters {
  double cluster, dimension, transition, new_transition, bandwidth, merge_distance;
  int weighting;  // 0 count, 1 exponential decay, 2 constant
  double weight, forget_below;
  int extra_directions, max_dimension;
  long max_clusters, batch;
};

// First columns of a packed row, as ClusterColumn.
enum Column : int {
  CLUSTER_ID,
  WEIGHT,
  POINTS,
  DEMONSTRATION_STARTS,
  SEGMENTS,
  MEAN_DURATION,
  SQUARED_DEVIATIONS,
  CENSORED,
  MEAN_CENSORED_DURATION,
  COLUMNS
};

// Packed counters, as INITIAL_COUNTERS.
enum Counter : int {
  CURRENT,
  STEPS_IN_CLUSTER,
  NEXT_CLUSTER_ID,
  DATAPOINTS,
  PREVIOUS,
  PREVIOUS_STEPS,
  COUNTERS
};

// State of a stream while it changes. Clusters are rows as in a StreamState, in slots that are reused; order_
// lists the slots in the order of creation, which is the order of rows in a StreamState. work is memory that
// may be shared by successive streams.
class Stream {
 public:
  Stream(int P, int D, const StreamParameters& parameters, Subspaces& work);

  // Reads and writes K packed rows in which each subspace has space for `capacity` directions.
  void load(const double* head, const double* rows, const double* transition_counts, int K, int capacity);
  void store(double* head, double* rows, double* transition_counts, int capacity) const;
  int clusters() const { return int(order_.size()); }
  int capacity() const;  // largest number of directions of a subspace, padded to a multiple of four

  void observe(const double* x, long N, int64_t* cluster_ids, double* costs, double* changes);
  const std::vector<std::array<int64_t, 3>>& removed() const { return removed_; }

 private:
  struct Choice {
    int slot;  // -1 for a new cluster
    double cost;
    double loss_change;  // of the datapoint, if it creates a cluster
  };

  Choice assign_point(const double* x);
  bool update_best(const double* x, int slot, double transition, double* best, int* chosen, int k);
  int create_cluster(const double* x, long n);
  double update_transitions(int slot);
  double update_cluster(const double* x, int slot);
  void update_weights(int slot, bool is_new);
  void remove_light_clusters(long n);
  void merge_close_clusters(int slot, long n);
  int merge_clusters(int a, int b, long n);
  void remove_cluster(int slot, long n, int64_t into);
  void remove_segment_duration(double* statistics, double steps) const;
  void pool_durations(double* a, const double* b, int number, int mean, int squares) const;
  int find_slot(int64_t cluster_id) const;

  void reserve_slots(int slots);
  void reserve_capacity(int capacity);
  void copy_row(const double* from, const Layout& narrow, double* to, const Layout& wide) const;
  const double* log_counts(int slot);
  size_t row_length() const { return COLUMNS + P_ * layout_.block(); }
  double* statistics(int slot) { return &rows_[size_t(slot) * row_length()]; }
  const double* statistics(int slot) const { return &rows_[size_t(slot) * row_length()]; }
  double* transition_counts(int slot) { return &counts_[size_t(slot) * slots_]; }
  double* block(int slot, int p) { return statistics(slot) + COLUMNS + p * layout_.block(); }
  Subspace subspace(int slot, int p) { return layout_.at(block(slot, p)); }

  int P_, D_;
  StreamParameters parameters_;
  Layout layout_;
  Subspaces& subspaces_;
  int slots_ = 0;
  std::vector<int> order_, free_;
  Eigen::VectorXd rows_,
      logs_;  // logs_: row i has the logarithms of the counts of slot i, valid if logs_valid_
  Buffer counts_;
  std::vector<double> totals_;
  std::vector<char> logs_valid_;
  Buffer point_, error_, g_;
  std::vector<char> is_new_;          // of a batch: whether a datapoint created its cluster
  std::vector<int64_t> assigned_;     // of a batch: clusters with new datapoints
  int current_ = -1, previous_ = -1;  // slots; -1 at the start of a demonstration
  double steps_ = 0.0, next_cluster_id_ = 0.0, datapoints_ = 0.0, previous_steps_ = 0.0;
  std::vector<std::array<int64_t, 3>> removed_;
};

}  // namespace pilotfish
