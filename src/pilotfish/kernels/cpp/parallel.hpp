// Demonstrations cut into groups that several threads share.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

namespace pilotfish {

struct Group {
  long first, last;  // demonstrations, the last one excluded
  long begin;        // datapoints before the first
};

// At most a few groups of about equally many datapoints, at least `worth` in each. They depend on nothing but
// the arguments: sums over groups, added in order, are the same to the last digit on any computer.
std::vector<Group> split_groups(const int64_t* lengths, long M, double min_points);

// Calls work(0) to work(count - 1), each once, on up to `threads` threads; zero is as many as this process
// may use. What work throws is thrown here, once all threads have ended.
void run_groups(int count, int threads, const std::function<void(int)>& work);

}  // namespace pilotfish
