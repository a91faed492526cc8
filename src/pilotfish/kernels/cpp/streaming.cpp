#include "streaming.hpp"

#include <algorithm>
#include <cmath>

namespace pilotfish {

namespace {

constexpr double STRAIGHTEN_EVERY = 256.0;  // datapoints of a cluster
constexpr double ENDLESS = std::numeric_limits<double>::infinity();

// Rows of so many numbers into rows of others; what there is no place for is zero.
void copy_rows(const double* from, int wide, double* to, int capacity, int rows) {
  if (wide == capacity) {
    std::copy_n(from, size_t(rows) * capacity, to);
    return;
  }
  for (int d = 0; d < rows; ++d)
    std::copy_n(from + size_t(d) * wide, std::min(wide, capacity), to + size_t(d) * capacity);
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
    for (int p = 0; p < P_; ++p) most = std::max(most, numbers(slot)[NUMBERS + p * layout_.block() + 1]);
  return round_up_to_four(int(most));
}

void Stream::reserve_slots(int slots) {
  if (slots <= slots_) return;
  Buffer transition_counts(size_t(slots) * slots);
  copy_rows(counts_.data(), slots_, transition_counts.data(), slots, slots_);
  counts_.swap(transition_counts);
  logs_.resize(Eigen::Index(slots) * slots);
  rows_.conservativeResize(Eigen::Index(slots) * row());
  totals_.resize(slots);
  ready_.assign(slots, 0);
  order_.reserve(slots);
  free_.reserve(slots);
  for (int slot = slots - 1; slot >= slots_; --slot) free_.push_back(slot);
  slots_ = slots;
}

// A row of one layout as one of another, which has room for all of its directions.
void Stream::copy_row(const double* from, const Layout& narrow, double* to, const Layout& wide) const {
  if (narrow.capacity == wide.capacity) {
    std::copy_n(from, NUMBERS + P_ * wide.block(), to);
    return;
  }
  std::copy_n(from, int(NUMBERS), to);
  std::fill_n(to + NUMBERS, P_ * wide.block(), 0.0);
  for (int p = 0; p < P_; ++p) {
    const double* block = from + NUMBERS + p * narrow.block();
    const Subspace target = wide.at(to + NUMBERS + p * wide.block());
    const double* variances = block + 2 + narrow.rows;
    const int capacity = std::min(narrow.capacity, wide.capacity);
    std::copy_n(block, 2 + narrow.rows, target.dimension);
    std::copy_n(variances, capacity, target.variances);
    std::copy_n(variances + narrow.capacity, capacity + 1, target.distances);
    copy_rows(variances + 2 * narrow.capacity + 4, narrow.capacity, target.basis, wide.capacity, D_);
  }
}

void Stream::reserve_room(int capacity) {
  if (capacity <= layout_.capacity) return;
  const Layout wide{D_, layout_.rows, round_up_to_four(capacity)};
  Eigen::VectorXd rows(Eigen::Index(slots_) * (NUMBERS + P_ * wide.block()));
  for (int slot : order_) copy_row(numbers(slot), layout_, &rows[slot * (NUMBERS + P_ * wide.block())], wide);
  rows_.swap(rows);
  layout_ = wide;
}

void Stream::load(const double* head, const double* rows, const double* transition_counts, int K, int capacity) {
  layout_.capacity = capacity;
  g_.resize(round_up_to_four(D_));
  reserve_slots(std::max(K + 1, 4));
  std::copy_n(rows, K * row(), rows_.data());
  for (int k = 0; k < K; ++k) order_.push_back(k);
  free_.resize(slots_ - K);  // the first slots are taken: they are the last in it
  copy_rows(transition_counts, K, counts_.data(), slots_, K);
  for (int i = 0; i < K; ++i) {
    double total = 0.0;
    for (int j = 0; j < K; ++j) total += transition_counts[size_t(i) * K + j];
    totals_[i] = total;
  }
  current_ = head[CURRENT] < 0.0 ? -1 : int(head[CURRENT]);
  steps_ = head[STEPS_IN_CLUSTER];
  next_ = head[NEXT_CLUSTER_ID];
  seen_ = head[POINTS_TOTAL];
  before_ = head[PREVIOUS] < 0.0 ? -1 : int(head[PREVIOUS]);
  before_steps_ = head[PREVIOUS_STEPS];
}

void Stream::store(double* head, double* rows, double* transition_counts, int capacity) const {
  const int K = clusters();
  const Layout outside{D_, layout_.rows, capacity};
  head[CURRENT] = head[PREVIOUS] = -1.0;
  for (int k = 0; k < K; ++k) {
    const int slot = order_[k];
    if (slot == current_) head[CURRENT] = k;
    if (slot == before_) head[PREVIOUS] = k;
    copy_row(numbers(slot), layout_, rows + k * (NUMBERS + P_ * outside.block()), outside);
    for (int j = 0; j < K; ++j) transition_counts[size_t(k) * K + j] = counts_[size_t(slot) * slots_ + order_[j]];
  }
  head[STEPS_IN_CLUSTER] = steps_;
  head[NEXT_CLUSTER_ID] = next_;
  head[POINTS_TOTAL] = seen_;
  head[PREVIOUS_STEPS] = before_steps_;
}

void Stream::observe(const double* x, long N, int64_t* cluster_ids, double* costs, double* changes) {
  const int rows = layout_.rows;
  const long most = std::min(parameters_.batch, N);
  fresh_.assign(most, 0);
  const auto padded_point = [&](long n) {
    for (int p = 0; p < P_; ++p) std::copy_n(x + (n * P_ + p) * D_, D_, &point_[size_t(p) * rows]);
    return point_.data();
  };
  for (long begin = 0; begin < N; begin += parameters_.batch) {
    const long end = std::min(begin + parameters_.batch, N);
    for (long n = begin; n < end; ++n) {
      const double* point = padded_point(n);
      const Choice choice = assign(point);
      const bool fresh = choice.slot < 0;
      const int slot = fresh ? create(point, n) : choice.slot;
      fresh_[n - begin] = fresh;
      cluster_ids[n] = int64_t(numbers(slot)[CLUSTER_ID]);
      costs[n] = choice.cost;
      changes[n] = choice.saved + follow(slot);
    }
    for (long n = begin; n < end; ++n) {
      const int slot = slot_of(cluster_ids[n]);  // -1, where it made room for another meanwhile
      const bool fresh = fresh_[n - begin];
      if (slot >= 0 && !fresh) changes[n] += learn(end - begin == 1 ? point_.data() : padded_point(n), slot);
      update_weights(slot, fresh);
      if (parameters_.forget_below > 0.0) remove_light_clusters(n);
    }
    if (parameters_.merge_distance > 0.0) {
      touched_.clear();
      for (long n = begin; n < end; ++n)
        if (std::find(touched_.begin(), touched_.end(), cluster_ids[n]) == touched_.end())
          touched_.push_back(cluster_ids[n]);
      for (int64_t cluster_id : touched_) merge_close(slot_of(cluster_id), end - 1);
    }
  }
}

int Stream::slot_of(int64_t cluster_id) const {
  for (size_t k = order_.size(); k-- > 0;)
    if (numbers(order_[k])[CLUSTER_ID] == double(cluster_id)) return order_[k];
  return -1;
}

// log counts of the row, -inf where there is none.
const double* Stream::logs_of(int slot) {
  double* logs = &logs_[size_t(slot) * slots_];
  if (!ready_[slot]) {
    const double* row = transition_counts(slot);
    for (int j = 0; j < slots_; ++j) logs[j] = row[j] > 0.0 ? logarithm(row[j]) : NEVER;
    ready_[slot] = 1;
  }
  return logs;
}

// Whether x costs less in slot than the best so far, or as much and comes before; most are told from afar.
bool Stream::costs_less(const double* x, int slot, double transition, double* best, int* chosen, int place) {
  double cost = transition;
  for (int p = 0; p < P_; ++p) {
    const Subspace seen = subspace(slot, p);
    const double square = deviation(x + size_t(p) * layout_.rows, seen.mean, layout_.rows, error_.data());
    const int d = int(*seen.dimension);
    if (d == 0) {
      cost += square;
    } else {
      const double far = square / (square + parameters_.bandwidth);  // at most 1 - rho
      if (cost + far * far * square * (1.0 - 1e-12) > *best) return false;
      project(layout_, seen.basis, round_up_to_four(d), error_.data(), g_.data());
      const double inside = square_of_first(g_.data(), d);
      if (cost + (square - inside) - 1e-12 * square > *best) return false;  // rho is at most 1
      cost += std::max(square - nearness(square, parameters_.bandwidth) * inside, 0.0);
    }
    if (cost > *best) return false;
  }
  if (cost == *best && place > *chosen) return false;
  *best = cost;
  *chosen = place;
  return true;
}

Stream::Choice Stream::assign(const double* x) {
  const int K = clusters();
  double begin = parameters_.cluster, total = 0.0, fresh = 0.0;
  const double* logs = nullptr;
  if (current_ >= 0) {
    fresh = parameters_.transition * std::log(totals_[current_] + 1.0) + parameters_.new_transition;
    begin += fresh;
    if (parameters_.transition > 0.0 || parameters_.new_transition > 0.0) {
      logs = logs_of(current_);
      total = totals_[current_] > 0.0 ? std::log(totals_[current_]) : 0.0;
    }
  }
  double best = ENDLESS;
  int chosen = K;
  const auto look = [&](int k) {
    const int slot = order_[k];
    double transition = 0.0;
    if (logs) transition = logs[slot] > NEVER ? parameters_.transition * (total - logs[slot]) : fresh;
    costs_less(x, slot, transition, &best, &chosen, k);
  };
  int first = -1;
  if (current_ >= 0) {  // most likely it stays: what costs more is then told from afar
    first = int(std::find(order_.begin(), order_.end(), current_) - order_.begin());
    look(first);
  }
  for (int k = 0; k < K; ++k)
    if (k != first) look(k);
  if (chosen < K && best < begin) return {order_[chosen], best, 0.0};
  if (chosen == K) return {-1, begin, 0.0};
  double dimensions = 0.0;
  for (int p = 0; p < P_; ++p) dimensions += *subspace(order_[chosen], p).dimension;
  return {-1, begin, begin - best - parameters_.dimension * dimensions};
}

int Stream::create(const double* x, long n) {
  if (clusters() >= parameters_.clusters) {
    int lightest = -1;
    for (int other : order_) {
      if (other == current_ && clusters() > 1) continue;
      if (lightest < 0 || numbers(other)[WEIGHT] < numbers(lightest)[WEIGHT]) lightest = other;
    }
    remove(lightest, n, -1);
  }
  if (free_.empty()) reserve_slots(2 * slots_);
  const int slot = free_.back();
  free_.pop_back();
  order_.push_back(slot);
  double* own = numbers(slot);
  std::fill_n(own, row(), 0.0);
  own[CLUSTER_ID] = next_++;
  own[WEIGHT] = parameters_.weighting == 2 ? parameters_.weight : 1.0;
  for (int p = 0; p < P_; ++p)
    std::copy_n(x + size_t(p) * layout_.rows, layout_.rows, subspace(slot, p).mean);
  return slot;
}

double Stream::follow(int slot) {
  double* own = numbers(slot);
  double change = 0.0;
  own[POINTS] += 1.0;
  seen_ += 1.0;
  if (current_ < 0) {
    own[DEMONSTRATION_STARTS] += 1.0;
  } else {
    double &count = transition_counts(current_)[slot], &total = totals_[current_];
    if (count > 0.0 && parameters_.transition > 0.0)
      change = parameters_.transition * std::log(count / total * (total + 1.0) / (count + 1.0));
    count += 1.0;
    total += 1.0;
    if (ready_[current_]) logs_[size_t(current_) * slots_ + slot] = logarithm(count);
  }
  if (current_ == slot) {
    steps_ += 1.0;
    return change;
  }
  if (current_ >= 0) {
    double* left = numbers(current_);
    left[SEGMENTS] += 1.0;
    const double off = steps_ - left[MEAN_DURATION];
    left[MEAN_DURATION] += off / left[SEGMENTS];
    left[SQUARED_DEVIATIONS] += off * (steps_ - left[MEAN_DURATION]);
  }
  before_ = current_;
  before_steps_ = current_ < 0 ? 0.0 : steps_;
  current_ = slot;
  steps_ = 1.0;
  return change;
}

double Stream::learn(const double* x, int slot) {
  double change = 0.0;
  const Learning how{numbers(slot)[WEIGHT], parameters_.dimension, parameters_.bandwidth,
                     std::min(parameters_.directions, D_ - 1), parameters_.extra_directions};
  const bool check = std::fmod(numbers(slot)[POINTS], STRAIGHTEN_EVERY) == 0.0;
  for (int p = 0; p < P_; ++p) {
    change += subspaces_.learn(x + size_t(p) * layout_.rows, subspace(slot, p), layout_, how);
    if (subspaces_.rank() > layout_.capacity) {
      reserve_room(subspaces_.rank());
      subspaces_.keep(subspace(slot, p), layout_);
    }
    if (check) subspaces_.reorthonormalise(subspace(slot, p), layout_);
  }
  return change;
}

void Stream::update_weights(int slot, bool fresh) {
  if (parameters_.weighting == 0 && slot >= 0 && !fresh) numbers(slot)[WEIGHT] += 1.0;
  if (parameters_.weighting != 1) return;
  for (int other : order_) numbers(other)[WEIGHT] *= parameters_.weight;
  if (slot >= 0) numbers(slot)[WEIGHT] = fresh ? 1.0 : numbers(slot)[WEIGHT] + 1.0;
}

void Stream::remove_light_clusters(long n) {
  for (size_t k = 0; k < order_.size();) {
    const int slot = order_[k];
    if (numbers(slot)[WEIGHT] < parameters_.forget_below && slot != current_)
      remove(slot, n, -1);
    else
      ++k;
  }
}

void Stream::merge_close(int slot, long n) {
  const double limit = parameters_.merge_distance * parameters_.merge_distance;
  while (slot >= 0) {
    double least = ENDLESS;
    int nearest = -1;
    for (int other : order_) {
      if (other == slot) continue;
      double square = 0.0;
      for (int p = 0; p < P_ && square < limit; ++p)
        square += square_apart(subspace(slot, p).mean, subspace(other, p).mean, layout_.rows, limit);
      if (square < least) {
        least = square;
        nearest = other;
      }
    }
    if (!(least < limit)) return;
    slot = merge(slot, nearest, n);
  }
}

int Stream::merge(int slot, int other, long n) {
  const double mine = numbers(slot)[WEIGHT], theirs = numbers(other)[WEIGHT];
  if (theirs > mine || (theirs == mine && numbers(other)[CLUSTER_ID] < numbers(slot)[CLUSTER_ID]))
    std::swap(slot, other);
  const double run_groups = numbers(other)[WEIGHT] / (numbers(slot)[WEIGHT] + numbers(other)[WEIGHT]);
  for (int p = 0; p < P_; ++p) {
    subspaces_.merge(subspace(slot, p), subspace(other, p), layout_, run_groups, parameters_.extra_directions);
    reserve_room(subspaces_.rank());
    subspaces_.keep(subspace(slot, p), layout_);
  }
  double* a = numbers(slot);
  const double* b = numbers(other);
  pool(a, b, SEGMENTS, MEAN_DURATION, SQUARED_DEVIATIONS);
  pool(a, b, CENSORED, MEAN_CENSORED_DURATION, -1);
  a[POINTS] += b[POINTS];
  a[DEMONSTRATION_STARTS] += b[DEMONSTRATION_STARTS];
  if (parameters_.weighting != 2) a[WEIGHT] += b[WEIGHT];
  for (int j : order_) transition_counts(slot)[j] += transition_counts(other)[j];
  totals_[slot] += totals_[other];
  for (int i : order_) transition_counts(i)[slot] += transition_counts(i)[other];
  std::fill(ready_.begin(), ready_.end(), 0);
  if (current_ == other) current_ = slot;
  if (before_ == other) before_ = slot;
  if (current_ == before_ && current_ >= 0) {  // what was taken for two visits is one, and goes on
    remove_segment_duration(a, before_steps_);
    steps_ += before_steps_;
    before_ = -1;
    before_steps_ = 0.0;
  }
  remove(other, n, int64_t(a[CLUSTER_ID]));
  return slot;
}

// One complete visit of so many steps less.
void Stream::remove_segment_duration(double* own, double steps) const {
  own[SEGMENTS] -= 1.0;
  if (own[SEGMENTS] == 0.0) {
    own[MEAN_DURATION] = own[SQUARED_DEVIATIONS] = 0.0;
    return;
  }
  const double off = steps - own[MEAN_DURATION];
  own[MEAN_DURATION] -= off / own[SEGMENTS];
  own[SQUARED_DEVIATIONS] = std::max(own[SQUARED_DEVIATIONS] - off * (steps - own[MEAN_DURATION]), 0.0);
}

void Stream::pool(double* a, const double* b, int number, int mean, int squares) const {
  const double both = a[number] + b[number];
  if (both == 0.0) return;
  const double off = b[mean] - a[mean];
  if (squares >= 0) a[squares] += b[squares] + off * off * a[number] * b[number] / both;
  a[mean] += off * b[number] / both;
  a[number] = both;
}

// Of a cluster that another took in, the counts have gone to it; of one that is forgotten they are gone.
void Stream::remove(int slot, long n, int64_t into) {
  removed_.push_back({n, int64_t(numbers(slot)[CLUSTER_ID]), into});
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
  std::fill(ready_.begin(), ready_.end(), 0);
  if (current_ == slot) current_ = -1;
  if (before_ == slot) {
    before_ = -1;
    before_steps_ = 0.0;
  }
}

}  // namespace pilotfish
