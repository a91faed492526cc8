// Arrays exchanged with Python: accepted types, allocation of results, and checks of shapes and numbers.
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include <cstdint>
#include <cstring>
#include <initializer_list>
#include <limits>
#include <string>
#include <vector>

#include "subnormals.hpp"

namespace nb = nanobind;

namespace pilotfish::python {
template <typename Number, int Axes>
using Given = nb::ndarray<const Number, nb::ndim<Axes>, nb::c_contig, nb::device::cpu>;

// Array that a kernel reads in place; its type caster is below.
template <typename Number, int Axes>
struct In : Given<Number, Axes> {
  In() = default;
  explicit In(const Given<Number, Axes>& given) : Given<Number, Axes>(given) {}
};

using Out = nb::ndarray<nb::numpy, double, nb::c_contig>;
using States = nb::ndarray<nb::numpy, int64_t, nb::c_contig>;

}  // namespace pilotfish::python

namespace nanobind::detail {

// Accepts only arrays of this type, in native byte order, contiguous and aligned: to read an unaligned double
// is undefined behaviour. Nothing is converted here; kernels/compiled.py does that.
template <typename Number, int Axes>
struct type_caster<pilotfish::python::In<Number, Axes>> {
  using Array = pilotfish::python::In<Number, Axes>;
  NB_TYPE_CASTER(Array, const_name("numpy.ndarray"))

  bool from_python(handle source, uint8_t flags, cleanup_list* cleanup) noexcept {
    make_caster<pilotfish::python::Given<Number, Axes>> given;
    if (!given.from_python(source, flags & ~uint8_t(cast_flags::convert), cleanup)) return false;
    value = Array(given.value);
    return value.size() == 0 || reinterpret_cast<uintptr_t>(value.data()) % alignof(Number) == 0;
  }
};

}  // namespace nanobind::detail

namespace pilotfish::python {

template <typename Array>
Array empty(std::initializer_list<size_t> shape) {
  using Number = typename Array::Scalar;
  size_t size = 1;
  for (size_t axis : shape) size *= axis;
  auto* data = new Number[size];
  nb::capsule owner(data, [](void* p) noexcept { delete[] static_cast<Number*>(p); });
  return Array(data, shape.size(), shape.begin(), owner);
}

// Throws unless the array has the given shape, so that no kernel reads beyond an array.
template <typename Array>
void expect(const Array& array, const char* name, std::initializer_list<size_t> shape) {
  size_t axis = 0;
  for (size_t size : shape) {
    if (array.shape(axis) != size)
      throw nb::value_error((std::string(name) + " has " + std::to_string(array.shape(axis)) +
                             " entries along axis " + std::to_string(axis) + ", expected " +
                             std::to_string(size))
                                .c_str());
    ++axis;
  }
}

// Throws for numbers for which no kernel is defined; kernels/validation.py then writes the message. Doubles
// are compared through their bits as integers, which have the same order: such a loop vectorises.
constexpr double LARGEST_NUMBER = 1e150;  // as in validation.py: sums of squares do not overflow
constexpr int64_t MAGNITUDE = 0x7fffffffffffffff, INFINITE = 0x7ff0000000000000;  // as bits

inline int64_t bits_of(double number) {
  int64_t bits;
  std::memcpy(&bits, &number, sizeof bits);
  return bits;
}

template <typename Array>
void expect_finite(const Array& array, const char* name) {
  const double* numbers = array.data();
  const int64_t largest = bits_of(LARGEST_NUMBER);
  int64_t bad = 0;
  for (size_t i = 0, size = array.size(); i < size; ++i) bad |= (bits_of(numbers[i]) & MAGNITUDE) > largest;
  if (bad) throw nb::value_error((std::string(name) + " holds a number that is not finite").c_str());
}

// Throws for NaN and +inf; -inf is a valid logarithm.
template <typename Array>
void expect_logarithms(const Array& array, const char* name) {
  const double* numbers = array.data();
  const int64_t minus_infinity = bits_of(-std::numeric_limits<double>::infinity());
  int64_t bad = 0;
  for (size_t i = 0, size = array.size(); i < size; ++i) {
    const int64_t bits = bits_of(numbers[i]);
    bad |= ((bits & MAGNITUDE) >= INFINITE) & (bits != minus_infinity);
  }
  if (bad) throw nb::value_error((std::string(name) + " holds NaN or infinity").c_str());
}

inline void expect_some(size_t size, const char* name) {
  if (size == 0) throw nb::value_error((std::string(name) + " is empty, expected at least one").c_str());
}

// Returns the first columns of the quaternions among D columns.
inline std::vector<int> read_orientation_starts(const In<int64_t, 1>& orientation_starts, size_t D) {
  std::vector<int> starts;
  int64_t free = 0;
  for (size_t i = 0; i < orientation_starts.shape(0); free = orientation_starts(i++) + 4) {
    if (orientation_starts(i) < free || orientation_starts(i) > int64_t(D) - 4)
      throw nb::value_error("orientation_starts are not increasing columns with four columns each");
    starts.push_back(int(orientation_starts(i)));
  }
  return starts;
}

inline void expect_threads(int threads) {
  if (threads >= 0) return;
  const std::string is = "threads is " + std::to_string(threads);
  throw nb::value_error((is + ", expected a number, or 0 for all").c_str());
}

// Releases the GIL and flushes subnormal numbers while a kernel runs.
struct ReleasedInterpreter {
  nb::gil_scoped_release others;
  SubnormalsFlushed subnormals;
};

}  // namespace pilotfish::python
