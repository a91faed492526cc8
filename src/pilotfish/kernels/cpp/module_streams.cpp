// Python bindings of the kernels of streams.
#include <nanobind/stl/tuple.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <tuple>

#include "arrays.hpp"
#include "streaming.hpp"

namespace pilotfish::python {
namespace {

// Returns the index of the first value that is not finite or whose square overflows, or -1.
long first_invalid(const double* x, long size) {
  constexpr double MAX_VALUE = 1e100;
  bool valid = true;
  for (long i = 0; i < size; ++i) valid &= std::abs(x[i]) <= MAX_VALUE;
  if (valid) return -1;
  return std::find_if(x, x + size, [](double value) { return !(std::abs(value) <= MAX_VALUE); }) - x;
}

constexpr double MAX_EXACT_INTEGER = 9007199254740992.0;  // 2^53
constexpr double MAX_INT = 2147483647.0;
constexpr double MAX_PARAMETER[] = {2.0, MAX_INT, MAX_INT, MAX_EXACT_INTEGER, MAX_EXACT_INTEGER};
constexpr int INTEGER_PARAMETER[] = {6, 9, 10, 11, 12};

// Reads the parameters, which are in the order of the fields of StreamParameters.
StreamParameters read_parameters(const In<double, 1>& r) {
  expect(r, "parameters", {13});
  for (int i = 0; i < 5; ++i) {
    const double number = r(INTEGER_PARAMETER[i]);
    if (!(number >= 0.0 && number <= MAX_PARAMETER[i] && number == std::floor(number)))
      throw nb::value_error(
          "weighting, extra_directions, max_dimension, max_clusters or batch is not a valid whole number");
  }
  const StreamParameters parameters{r(0), r(1), r(2),      r(3),       r(4),        r(5),       int(r(6)),
                                    r(7), r(8), int(r(9)), int(r(10)), long(r(11)), long(r(12))};
  if (parameters.max_clusters < 1 || parameters.batch < 1)
    throw nb::value_error("max_clusters or batch is not positive");
  return parameters;
}

size_t row_length(size_t P, size_t D, size_t capacity) {
  return COLUMNS + P * Layout{int(D), round_up_to_four(int(D)), int(capacity)}.block();
}

// Returns the work memory of this thread: to allocate it would take as long as the update for a datapoint.
Subspaces& workspace(size_t D) {
  static thread_local std::unique_ptr<Subspaces> work;
  static thread_local size_t width = 0;
  if (width != D) {
    work = std::make_unique<Subspaces>(int(D));
    width = D;
  }
  return *work;
}

// Validates the packed state and loads it into the stream.
void load(Stream& stream, size_t P, size_t D, const In<double, 1>& head, const In<double, 2>& rows,
          const In<double, 2>& transition_counts, int capacity) {
  const size_t K = rows.shape(0);
  if (capacity < 0 || capacity % 4 || size_t(capacity) > D + 3)
    throw nb::value_error("capacity is not a multiple of 4 up to the columns of x");
  expect(head, "counters", {COUNTERS});
  expect(rows, "rows", {K, row_length(P, D, capacity)});
  expect(transition_counts, "transition_counts", {K, K});
  if (!(head(CURRENT) < double(K) && head(PREVIOUS) < double(K)))
    throw nb::value_error("counters name a cluster that does not exist");
  for (int i = 0; i < COUNTERS; ++i)
    if (!(head(i) >= (i == CURRENT || i == PREVIOUS ? -1.0 : 0.0) && head(i) <= MAX_EXACT_INTEGER &&
          head(i) == std::floor(head(i))))
      throw nb::value_error("a counter is not a whole number");
  const size_t block = (rows.shape(1) - COLUMNS) / P;
  for (size_t k = 0; k < K; ++k) {
    const double id = rows.data()[k * rows.shape(1) + CLUSTER_ID];
    if (!(std::abs(id) <= MAX_EXACT_INTEGER && id == std::floor(id)))
      throw nb::value_error("the identifier of a cluster is not a whole number up to 2^53");
    for (size_t p = 0; p < P; ++p) {
      const double* numbers = rows.data() + k * rows.shape(1) + COLUMNS + p * block;
      const bool whole = numbers[0] == std::floor(numbers[0]) && numbers[1] == std::floor(numbers[1]);
      if (!(whole && numbers[0] >= 0.0 && numbers[0] <= numbers[1] &&
            numbers[1] <= std::min(capacity, int(D))))
        throw nb::value_error("a cluster's dimension or number of directions is out of range");
    }
  }
  stream.load(head.data(), rows.data(), transition_counts.data(), int(K), capacity);
}

struct StoredStream {
  Out head, rows, transition_counts;
  int capacity;
};

StoredStream export_stream(const Stream& stream, size_t P, size_t D) {
  const size_t K = stream.clusters();
  const int capacity = stream.capacity();
  StoredStream stored{empty<Out>({COUNTERS}), empty<Out>({K, row_length(P, D, capacity)}), empty<Out>({K, K}),
                      capacity};
  stream.store(stored.head.data(), stored.rows.data(), stored.transition_counts.data(), capacity);
  return stored;
}

auto observe(In<double, 3> x, In<double, 1> head, In<double, 2> rows, In<double, 2> transition_counts,
             int capacity, In<double, 1> parameters) {
  const size_t P = x.shape(1), D = x.shape(2);
  expect_some(P, "the second axis of x");
  expect_some(D, "the last axis of x");
  Stream stream(int(P), int(D), read_parameters(parameters), workspace(D));
  load(stream, P, D, head, rows, transition_counts, capacity);
  const long failed_index = first_invalid(x.data(), long(x.size()));
  const size_t N = failed_index < 0 ? x.shape(0) : 0;
  States cluster_ids = empty<States>({N});
  Out costs = empty<Out>({N}), changes = empty<Out>({N});
  {
    ReleasedInterpreter run;
    stream.observe(x.data(), long(N), cluster_ids.data(), costs.data(), changes.data());
  }
  const StoredStream stored = export_stream(stream, P, D);
  States removed = empty<States>({stream.removed().size(), 3});
  for (size_t i = 0; i < stream.removed().size(); ++i)
    std::copy_n(stream.removed()[i].data(), 3, removed.data() + 3 * i);
  return std::make_tuple(failed_index, stored.head, stored.rows, stored.transition_counts, stored.capacity,
                         cluster_ids, costs, changes, removed);
}

// As observe, for one datapoint. It keeps the GIL: to release and acquire it would take longer than the work.
auto observe_one(In<double, 2> x, In<double, 1> head, In<double, 2> rows, In<double, 2> transition_counts,
                 int capacity, In<double, 1> parameters) {
  const size_t P = x.shape(0), D = x.shape(1);
  expect_some(P, "x");
  expect_some(D, "the last axis of x");
  Stream stream(int(P), int(D), read_parameters(parameters), workspace(D));
  load(stream, P, D, head, rows, transition_counts, capacity);
  const long failed_index = first_invalid(x.data(), long(x.size()));
  int64_t cluster_id = -1;
  double cost = 0.0, change = 0.0;
  {
    SubnormalsFlushed subnormals;
    stream.observe(x.data(), failed_index < 0, &cluster_id, &cost, &change);
  }
  const StoredStream stored = export_stream(stream, P, D);
  return std::make_tuple(failed_index, stored.head, stored.rows, stored.transition_counts, stored.capacity,
                         cluster_id, cost, change);
}

}  // namespace

void bind_streams(nb::module_& module) {
  module.def("observe", &observe);
  module.def("observe_one", &observe_one);
}

}  // namespace pilotfish::python
