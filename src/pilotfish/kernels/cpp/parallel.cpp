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

constexpr long MOST = 16;  // groups: their sums take memory

int available() {
#ifdef __linux__
  cpu_set_t allowed;
  if (sched_getaffinity(0, sizeof allowed, &allowed) == 0) return CPU_COUNT(&allowed);
#endif
  return int(std::max(1u, std::thread::hardware_concurrency()));
}

}  // namespace

std::vector<Group> split_groups(const int64_t* lengths, long M, double min_points) {
  long N = 0, done = 0;
  for (long m = 0; m < M; ++m) N += lengths[m];
  const long wanted = std::max(1L, std::min({MOST, M, long(double(N) / min_points)}));
  std::vector<Group> groups{{0, 0, 0}};
  for (long m = 0; m < M; ++m) {
    const long g = long(groups.size());
    // A group ends where the datapoints so far are nearest to its share of them all.
    if (g < wanted && m > groups.back().first && 2 * done + lengths[m] > 2 * N / wanted * g)
      groups.push_back({m, m, done});
    done += lengths[m];
    groups.back().last = m + 1;
  }
  return groups;
}

void run_groups(int count, int threads, const std::function<void(int)>& work) {
  std::atomic<int> next{0};
  std::exception_ptr thrown;
  std::mutex one_at_a_time;
  const auto work_on = [&] {
    const SubnormalsFlushed flushed;  // threads inherit it on Linux; no standard promises that
    try {
      for (int i; (i = next++) < count;) work(i);
    } catch (...) {
      const std::lock_guard<std::mutex> alone(one_at_a_time);
      thrown = std::current_exception();
      next = count;
    }
  };
  std::vector<std::thread> others;
  const int wanted = std::min(threads > 0 ? threads : available(), count) - 1;
  try {
    for (int i = 0; i < wanted; ++i) others.emplace_back(work_on);
  } catch (const std::system_error&) {  // no more threads to be had: fewer do the same work
  }
  work_on();
  for (std::thread& other : others) other.join();
  if (thrown) std::rethrow_exception(thrown);
}

}  // namespace pilotfish
