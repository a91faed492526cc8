// Memory of a stream: slots of clusters, layouts of rows, and conversion from and to a StreamState.
#include <algorithm>

#include "streaming.hpp"

namespace pilotfish {

namespace {

// Copies rows of from_width numbers into rows of to_width numbers; surplus numbers are dropped.
void copy_rows(const double* from, int from_width, double* to, int to_width, int rows) {
  if (from_width == to_width) {
    std::copy_n(from, size_t(rows) * to_width, to);
    return;
  }
  for (int d = 0; d < rows; ++d)
    std::copy_n(from + size_t(d) * from_width, std::min(from_width, to_width), to + size_t(d) * to_width);
}

}  // namespace

Stream::Stream(int P, int D, const StreamParameters& parameters, Subspaces& work)
    : P_(P),
      D_(D),
      parameters_(parameters),
      layout_{D, round_up_to_four(D), 0},
      subspaces_(work),
      point_(size_t(P) * round_up_to_four(D)),
      error_(round_up_to_four(D)) {}

int Stream::capacity() const {
  double most = 0;
  for (int slot : order_)
    for (int p = 0; p < P_; ++p) most = std::max(most, statistics(slot)[COLUMNS + p * layout_.block() + 1]);
  return round_up_to_four(int(most));
}

void Stream::reserve_slots(int slots) {
  if (slots <= slots_) return;
  Buffer transition_counts(size_t(slots) * slots);
  copy_rows(counts_.data(), slots_, transition_counts.data(), slots, slots_);
  counts_.swap(transition_counts);
  logs_.resize(Eigen::Index(slots) * slots);
  rows_.conservativeResize(Eigen::Index(slots) * row_length());
  totals_.resize(slots);
  logs_valid_.assign(slots, 0);
  order_.reserve(slots);
  free_.reserve(slots);
  for (int slot = slots - 1; slot >= slots_; --slot) free_.push_back(slot);
  slots_ = slots;
}

// Copies a row to another layout, which has space for all of its directions.
void Stream::copy_row(const double* from, const Layout& from_layout, double* to,
                      const Layout& to_layout) const {
  if (from_layout.capacity == to_layout.capacity) {
    std::copy_n(from, COLUMNS + P_ * to_layout.block(), to);
    return;
  }
  std::copy_n(from, int(COLUMNS), to);
  std::fill_n(to + COLUMNS, P_ * to_layout.block(), 0.0);
  for (int p = 0; p < P_; ++p) {
    const double* block = from + COLUMNS + p * from_layout.block();
    const Subspace target = to_layout.at(to + COLUMNS + p * to_layout.block());
    const double* variances = block + 2 + from_layout.rows;
    const int capacity = std::min(from_layout.capacity, to_layout.capacity);
    std::copy_n(block, 2 + from_layout.rows, target.dimension);
    std::copy_n(variances, capacity, target.variances);
    std::copy_n(variances + from_layout.capacity, capacity + 1, target.distances);
    copy_rows(variances + 2 * from_layout.capacity + 4, from_layout.capacity, target.basis,
              to_layout.capacity, D_);
  }
}

void Stream::reserve_capacity(int capacity) {
  if (capacity <= layout_.capacity) return;
  const Layout to_layout{D_, layout_.rows, round_up_to_four(capacity)};
  Eigen::VectorXd rows(Eigen::Index(slots_) * (COLUMNS + P_ * to_layout.block()));
  for (int slot : order_)
    copy_row(statistics(slot), layout_, &rows[slot * (COLUMNS + P_ * to_layout.block())], to_layout);
  rows_.swap(rows);
  layout_ = to_layout;
}

void Stream::load(const double* head, const double* rows, const double* transition_counts, int K,
                  int capacity) {
  layout_.capacity = capacity;
  g_.resize(round_up_to_four(D_));
  reserve_slots(std::max(K + 1, 4));
  std::copy_n(rows, K * row_length(), rows_.data());
  for (int k = 0; k < K; ++k) order_.push_back(k);
  free_.resize(slots_ - K);  // removes the first K slots, which are at the end
  copy_rows(transition_counts, K, counts_.data(), slots_, K);
  for (int i = 0; i < K; ++i) {
    double total = 0.0;
    for (int j = 0; j < K; ++j) total += transition_counts[size_t(i) * K + j];
    totals_[i] = total;
  }
  current_ = head[CURRENT] < 0.0 ? -1 : int(head[CURRENT]);
  steps_ = head[STEPS_IN_CLUSTER];
  next_cluster_id_ = head[NEXT_CLUSTER_ID];
  datapoints_ = head[DATAPOINTS];
  previous_ = head[PREVIOUS] < 0.0 ? -1 : int(head[PREVIOUS]);
  previous_steps_ = head[PREVIOUS_STEPS];
}

void Stream::store(double* head, double* rows, double* transition_counts, int capacity) const {
  const int K = clusters();
  const Layout packed{D_, layout_.rows, capacity};
  head[CURRENT] = head[PREVIOUS] = -1.0;
  for (int k = 0; k < K; ++k) {
    const int slot = order_[k];
    if (slot == current_) head[CURRENT] = k;
    if (slot == previous_) head[PREVIOUS] = k;
    copy_row(statistics(slot), layout_, rows + k * (COLUMNS + P_ * packed.block()), packed);
    for (int j = 0; j < K; ++j)
      transition_counts[size_t(k) * K + j] = counts_[size_t(slot) * slots_ + order_[j]];
  }
  head[STEPS_IN_CLUSTER] = steps_;
  head[NEXT_CLUSTER_ID] = next_cluster_id_;
  head[DATAPOINTS] = datapoints_;
  head[PREVIOUS_STEPS] = previous_steps_;
}

}  // namespace pilotfish
