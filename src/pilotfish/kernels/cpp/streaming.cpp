#include "streaming.hpp"

#include <algorithm>
#include <cmath>

namespace pilotfish {

namespace {

constexpr double ORTHONORMALISE_EVERY = 256.0;  // datapoints of a cluster
constexpr double INFINITE = std::numeric_limits<double>::infinity();

}  // namespace

void Stream::observe(const double* x, long N, int64_t* cluster_ids, double* costs, double* changes) {
  const int rows = layout_.rows;
  const long most = std::min(parameters_.batch, N);
  is_new_.assign(most, 0);
  const auto padded_point = [&](long n) {
    for (int p = 0; p < P_; ++p) std::copy_n(x + (n * P_ + p) * D_, D_, &point_[size_t(p) * rows]);
    return point_.data();
  };
  for (long begin = 0; begin < N; begin += parameters_.batch) {
    const long end = std::min(begin + parameters_.batch, N);
    for (long n = begin; n < end; ++n) {
      const double* point = padded_point(n);
      const Choice choice = assign_point(point);
      const bool is_new = choice.slot < 0;
      const int slot = is_new ? create_cluster(point, n) : choice.slot;
      is_new_[n - begin] = is_new;
      cluster_ids[n] = int64_t(statistics(slot)[CLUSTER_ID]);
      costs[n] = choice.cost;
      changes[n] = choice.loss_change + update_transitions(slot);
    }
    for (long n = begin; n < end; ++n) {
      const int slot = find_slot(cluster_ids[n]);  // -1 if it was removed in this batch
      const bool is_new = is_new_[n - begin];
      if (slot >= 0 && !is_new)
        changes[n] += update_cluster(end - begin == 1 ? point_.data() : padded_point(n), slot);
      update_weights(slot, is_new);
      if (parameters_.forget_below > 0.0) remove_light_clusters(n);
    }
    if (parameters_.merge_distance > 0.0) {
      assigned_.clear();
      for (long n = begin; n < end; ++n)
        if (std::find(assigned_.begin(), assigned_.end(), cluster_ids[n]) == assigned_.end())
          assigned_.push_back(cluster_ids[n]);
      for (int64_t cluster_id : assigned_) merge_close_clusters(find_slot(cluster_id), end - 1);
    }
  }
}

int Stream::find_slot(int64_t cluster_id) const {
  for (size_t k = order_.size(); k-- > 0;)
    if (statistics(order_[k])[CLUSTER_ID] == double(cluster_id)) return order_[k];
  return -1;
}

// Returns the logarithms of the transition counts of a row, -inf for zero.
const double* Stream::log_counts(int slot) {
  double* logs = &logs_[size_t(slot) * slots_];
  if (!logs_valid_[slot]) {
    const double* counts = transition_counts(slot);
    for (int j = 0; j < slots_; ++j) logs[j] = counts[j] > 0.0 ? logarithm(counts[j]) : NEVER;
    logs_valid_[slot] = 1;
  }
  return logs;
}

// Updates best and chosen if x costs less in cluster k than the best so far, or as much and k is lower. Lower
// bounds of the cost reject most clusters before it is computed.
bool Stream::update_best(const double* x, int slot, double transition, double* best, int* chosen, int k) {
  double cost = transition;
  for (int p = 0; p < P_; ++p) {
    const Subspace subspace_p = subspace(slot, p);
    const double square =
        deviation(x + size_t(p) * layout_.rows, subspace_p.mean, layout_.rows, error_.data());
    const int d = int(*subspace_p.dimension);
    if (d == 0) {
      cost += square;
    } else {
      const double far = square / (square + parameters_.bandwidth);  // at most 1 - rho
      if (cost + far * far * square * (1.0 - 1e-12) > *best) return false;
      project(layout_, subspace_p.basis, round_up_to_four(d), error_.data(), g_.data());
      const double inside = square_of_first(g_.data(), d);
      if (cost + (square - inside) - 1e-12 * square > *best) return false;  // rho is at most 1
      cost += std::max(square - projection_weight(square, parameters_.bandwidth) * inside, 0.0);
    }
    if (cost > *best) return false;
  }
  if (cost == *best && k > *chosen) return false;
  *best = cost;
  *chosen = k;
  return true;
}

Stream::Choice Stream::assign_point(const double* x) {
  const int K = clusters();
  double new_cost = parameters_.cluster, log_total = 0.0, new_transition = 0.0;
  const double* logs = nullptr;
  if (current_ >= 0) {
    new_transition = parameters_.transition * std::log(totals_[current_] + 1.0) + parameters_.new_transition;
    new_cost += new_transition;
    if (parameters_.transition > 0.0 || parameters_.new_transition > 0.0) {
      logs = log_counts(current_);
      log_total = totals_[current_] > 0.0 ? std::log(totals_[current_]) : 0.0;
    }
  }
  double best = INFINITE;
  int chosen = K;
  const auto try_cluster = [&](int k) {
    const int slot = order_[k];
    double transition = 0.0;
    if (logs)
      transition = logs[slot] > NEVER ? parameters_.transition * (log_total - logs[slot]) : new_transition;
    update_best(x, slot, transition, &best, &chosen, k);
  };
  int first = -1;
  if (current_ >= 0) {  // the most likely choice; its cost rejects most other clusters
    first = int(std::find(order_.begin(), order_.end(), current_) - order_.begin());
    try_cluster(first);
  }
  for (int k = 0; k < K; ++k)
    if (k != first) try_cluster(k);
  if (chosen < K && best < new_cost) return {order_[chosen], best, 0.0};
  if (chosen == K) return {-1, new_cost, 0.0};
  double dimensions = 0.0;
  for (int p = 0; p < P_; ++p) dimensions += *subspace(order_[chosen], p).dimension;
  return {-1, new_cost, new_cost - best - parameters_.dimension * dimensions};
}

int Stream::create_cluster(const double* x, long n) {
  if (clusters() >= parameters_.max_clusters) {
    int lightest = -1;
    for (int other : order_) {
      if (other == current_ && clusters() > 1) continue;
      if (lightest < 0 || statistics(other)[WEIGHT] < statistics(lightest)[WEIGHT]) lightest = other;
    }
    remove_cluster(lightest, n, -1);
  }
  if (free_.empty()) reserve_slots(2 * slots_);
  const int slot = free_.back();
  free_.pop_back();
  order_.push_back(slot);
  double* values = statistics(slot);
  std::fill_n(values, row_length(), 0.0);
  values[CLUSTER_ID] = next_cluster_id_++;
  values[WEIGHT] = parameters_.weighting == 2 ? parameters_.weight : 1.0;
  for (int p = 0; p < P_; ++p)
    std::copy_n(x + size_t(p) * layout_.rows, layout_.rows, subspace(slot, p).mean);
  return slot;
}

double Stream::update_transitions(int slot) {
  double* values = statistics(slot);
  double change = 0.0;
  values[POINTS] += 1.0;
  datapoints_ += 1.0;
  if (current_ < 0) {
    values[DEMONSTRATION_STARTS] += 1.0;
  } else {
    double &count = transition_counts(current_)[slot], &total = totals_[current_];
    if (count > 0.0 && parameters_.transition > 0.0)
      change = parameters_.transition * std::log(count / total * (total + 1.0) / (count + 1.0));
    count += 1.0;
    total += 1.0;
    if (logs_valid_[current_]) logs_[size_t(current_) * slots_ + slot] = logarithm(count);
  }
  if (current_ == slot) {
    steps_ += 1.0;
    return change;
  }
  if (current_ >= 0) {
    double* left = statistics(current_);
    left[SEGMENTS] += 1.0;
    const double deviation = steps_ - left[MEAN_DURATION];
    left[MEAN_DURATION] += deviation / left[SEGMENTS];
    left[SQUARED_DEVIATIONS] += deviation * (steps_ - left[MEAN_DURATION]);
  }
  previous_ = current_;
  previous_steps_ = current_ < 0 ? 0.0 : steps_;
  current_ = slot;
  steps_ = 1.0;
  return change;
}

double Stream::update_cluster(const double* x, int slot) {
  double change = 0.0;
  const UpdateSettings settings{statistics(slot)[WEIGHT], parameters_.dimension, parameters_.bandwidth,
                                std::min(parameters_.max_dimension, D_ - 1), parameters_.extra_directions};
  const bool check = std::fmod(statistics(slot)[POINTS], ORTHONORMALISE_EVERY) == 0.0;
  for (int p = 0; p < P_; ++p) {
    change += subspaces_.update(x + size_t(p) * layout_.rows, subspace(slot, p), layout_, settings);
    if (subspaces_.rank() > layout_.capacity) {
      reserve_capacity(subspaces_.rank());
      subspaces_.keep(subspace(slot, p), layout_);
    }
    if (check) subspaces_.reorthonormalise(subspace(slot, p), layout_);
  }
  return change;
}

void Stream::update_weights(int slot, bool is_new) {
  if (parameters_.weighting == 0 && slot >= 0 && !is_new) statistics(slot)[WEIGHT] += 1.0;
  if (parameters_.weighting != 1) return;
  for (int other : order_) statistics(other)[WEIGHT] *= parameters_.weight;
  if (slot >= 0) statistics(slot)[WEIGHT] = is_new ? 1.0 : statistics(slot)[WEIGHT] + 1.0;
}

void Stream::remove_light_clusters(long n) {
  for (size_t k = 0; k < order_.size();) {
    const int slot = order_[k];
    if (statistics(slot)[WEIGHT] < parameters_.forget_below && slot != current_)
      remove_cluster(slot, n, -1);
    else
      ++k;
  }
}

void Stream::merge_close_clusters(int slot, long n) {
  const double limit = parameters_.merge_distance * parameters_.merge_distance;
  while (slot >= 0) {
    double smallest = INFINITE;
    int nearest = -1;
    for (int other : order_) {
      if (other == slot) continue;
      double square = 0.0;
      for (int p = 0; p < P_ && square < limit; ++p)
        square +=
            bounded_squared_distance(subspace(slot, p).mean, subspace(other, p).mean, layout_.rows, limit);
      if (square < smallest) {
        smallest = square;
        nearest = other;
      }
    }
    if (!(smallest < limit)) return;
    slot = merge_clusters(slot, nearest, n);
  }
}

int Stream::merge_clusters(int slot, int other, long n) {
  const double weight = statistics(slot)[WEIGHT], other_weight = statistics(other)[WEIGHT];
  if (other_weight > weight ||
      (other_weight == weight && statistics(other)[CLUSTER_ID] < statistics(slot)[CLUSTER_ID]))
    std::swap(slot, other);
  const double fraction = statistics(other)[WEIGHT] / (statistics(slot)[WEIGHT] + statistics(other)[WEIGHT]);
  for (int p = 0; p < P_; ++p) {
    subspaces_.merge(subspace(slot, p), subspace(other, p), layout_, fraction, parameters_.extra_directions);
    reserve_capacity(subspaces_.rank());
    subspaces_.keep(subspace(slot, p), layout_);
  }
  double* a = statistics(slot);
  const double* b = statistics(other);
  pool_durations(a, b, SEGMENTS, MEAN_DURATION, SQUARED_DEVIATIONS);
  pool_durations(a, b, CENSORED, MEAN_CENSORED_DURATION, -1);
  a[POINTS] += b[POINTS];
  a[DEMONSTRATION_STARTS] += b[DEMONSTRATION_STARTS];
  if (parameters_.weighting != 2) a[WEIGHT] += b[WEIGHT];
  for (int j : order_) transition_counts(slot)[j] += transition_counts(other)[j];
  totals_[slot] += totals_[other];
  for (int i : order_) transition_counts(i)[slot] += transition_counts(i)[other];
  std::fill(logs_valid_.begin(), logs_valid_.end(), 0);
  if (current_ == other) current_ = slot;
  if (previous_ == other) previous_ = slot;
  if (current_ == previous_ && current_ >= 0) {  // the two segments are one, which continues
    remove_segment_duration(a, previous_steps_);
    steps_ += previous_steps_;
    previous_ = -1;
    previous_steps_ = 0.0;
  }
  remove_cluster(other, n, int64_t(a[CLUSTER_ID]));
  return slot;
}

// Removes one completed segment from the duration statistics.
void Stream::remove_segment_duration(double* values, double steps) const {
  values[SEGMENTS] -= 1.0;
  if (values[SEGMENTS] == 0.0) {
    values[MEAN_DURATION] = values[SQUARED_DEVIATIONS] = 0.0;
    return;
  }
  const double deviation = steps - values[MEAN_DURATION];
  values[MEAN_DURATION] -= deviation / values[SEGMENTS];
  values[SQUARED_DEVIATIONS] =
      std::max(values[SQUARED_DEVIATIONS] - deviation * (steps - values[MEAN_DURATION]), 0.0);
}

void Stream::pool_durations(double* a, const double* b, int number, int mean, int squares) const {
  const double total = a[number] + b[number];
  if (total == 0.0) return;
  const double deviation = b[mean] - a[mean];
  if (squares >= 0) a[squares] += b[squares] + deviation * deviation * a[number] * b[number] / total;
  a[mean] += deviation * b[number] / total;
  a[number] = total;
}

// Removes a cluster and its transition counts; merge_clusters has added them to the other cluster before.
void Stream::remove_cluster(int slot, long n, int64_t into) {
  removed_.push_back({n, int64_t(statistics(slot)[CLUSTER_ID]), into});
  order_.erase(std::find(order_.begin(), order_.end(), slot));
  free_.push_back(slot);
  std::fill_n(transition_counts(slot), slots_, 0.0);
  totals_[slot] = 0.0;
  for (int i : order_) {
    double total = 0.0;
    transition_counts(i)[slot] = 0.0;
    for (int j : order_) total += transition_counts(i)[j];
    totals_[i] = total;
  }
  std::fill(logs_valid_.begin(), logs_valid_.end(), 0);
  if (current_ == slot) current_ = -1;
  if (previous_ == slot) {
    previous_ = -1;
    previous_steps_ = 0.0;
  }
}

}  // namespace pilotfish
