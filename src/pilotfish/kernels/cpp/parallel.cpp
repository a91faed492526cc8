#include "parallel.hpp"

#include <algorithm>
#include <atomic>
#include <exception>
#include <mutex>
#include <system_error>
#include <thread>

#include "subnormals.hpp"

#ifdef __linux__
#include <sched.h>
#endif

namespace pilotfish {

namespace {

constexpr long MAX_GROUPS = 16;  // each has its own sums in memory

int available_cores() {
#ifdef __linux__
  cpu_set_t allowed;
  if (sched_getaffinity(0, sizeof allowed, &allowed) == 0) return CPU_COUNT(&allowed);
#endif
  return int(std::max(1u, std::thread::hardware_concurrency()));
}

}  // namespace

std::vector<Group> split_groups(const int64_t* lengths, long M, double min_points) {
  long N = 0, before = 0;
  for (long m = 0; m < M; ++m) N += lengths[m];
  const long count = std::max(1L, std::min({MAX_GROUPS, M, long(double(N) / min_points)}));
  std::vector<Group> groups{{0, 0, 0}};
  for (long m = 0; m < M; ++m) {
    const long g = long(groups.size());
    // A group ends where the number of datapoints so far is nearest to its fraction of all.
    if (g < count && m > groups.back().first && 2 * before + lengths[m] > 2 * N / count * g)
      groups.push_back({m, m, before});
    before += lengths[m];
    groups.back().last = m + 1;
  }
  return groups;
}

void run_groups(int count, int threads, const std::function<void(int)>& work) {
  std::atomic<int> next{0};
  std::exception_ptr thrown;
  std::mutex mutex;
  const auto work_on = [&] {
    const SubnormalsFlushed flushed;  // inherited on Linux, but not guaranteed by a standard
    try {
      for (int i; (i = next++) < count;) work(i);
    } catch (...) {
      const std::lock_guard<std::mutex> lock(mutex);
      thrown = std::current_exception();
      next = count;
    }
  };
  std::vector<std::thread> workers;
  const int worker_count = std::min(threads > 0 ? threads : available_cores(), count) - 1;
  try {
    for (int i = 0; i < worker_count; ++i) workers.emplace_back(work_on);
  } catch (const std::system_error&) {  // no more threads available: fewer do the work
  }
  work_on();
  for (std::thread& worker : workers) worker.join();
  if (thrown) std::rethrow_exception(thrown);
}

}  // namespace pilotfish
