// Groups of demonstrations, which several threads process.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

namespace pilotfish {

struct Group {
  long first, last;  // demonstrations first .. last - 1
  long begin;        // number of datapoints before them
};

// Returns groups of about equal numbers of datapoints, at least min_points in each. They depend only on the
// arguments, so that sums over groups, added in order, have the same bits on every computer.
std::vector<Group> split_groups(const int64_t* lengths, long M, double min_points);

// Calls work(0) .. work(count - 1), each once, on up to `threads` threads; zero means all cores of this
// process. Rethrows an exception of work after all threads have ended.
void run_groups(int count, int threads, const std::function<void(int)>& work);

}  // namespace pilotfish
