// Flushes subnormal numbers (below 1e-308) to zero while the object exists: they slow down a processor by
// 100.
#pragma once

#if defined(__SSE2__) || defined(_M_X64)
#include <xmmintrin.h>

namespace pilotfish {

class SubnormalsFlushed {
 public:
  SubnormalsFlushed() : before_(_mm_getcsr()) { _mm_setcsr(before_ | FLUSH_RESULTS | FLUSH_OPERANDS); }
  ~SubnormalsFlushed() { _mm_setcsr(before_); }
  SubnormalsFlushed(const SubnormalsFlushed&) = delete;
  SubnormalsFlushed& operator=(const SubnormalsFlushed&) = delete;

 private:
  static constexpr unsigned FLUSH_RESULTS = 0x8000, FLUSH_OPERANDS = 0x0040;  // of the register MXCSR
  unsigned before_;
};

}  // namespace pilotfish

#else

namespace pilotfish {

struct SubnormalsFlushed {
  SubnormalsFlushed() {}  // not needed on other processors
};

}  // namespace pilotfish

#endif
