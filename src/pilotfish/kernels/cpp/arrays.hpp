// Arrays between Python and the kernels: which are taken, how results are made, and checks of shapes.
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include <cstdint>
#include <cstring>
#include <initializer_list>
#include <limits>
#include <string>

namespace nb = nanobind;

namespace pilotfish::python {
template <typename Number, int Axes>
using Given = nb::ndarray<const Number, nb::ndim<Axes>, nb::c_contig, nb::device::cpu>;

// An array that a kernel reads where it is. See its caster below.
template <typename Number, int Axes>
struct In : Given<Number, Axes> {
  In() = default;
  explicit In(const Given<Number, Axes>& given) : Given<Number, Axes>(given) {}
};

using Out = nb::ndarray<nb::numpy, double, nb::c_contig>;
using States = nb::ndarray<nb::numpy, int64_t, nb::c_contig>;

}  // namespace pilotfish::python

namespace nanobind::detail {

// Only arrays of exactly these numbers are taken: of native byte order, contiguous, and aligned, because to read
// a double at an odd address is undefined. Nothing is converted here; kernels/compiled.py does it.
template <typename Number, int Axes>
struct type_caster<pilotfish::python::In<Number, Axes>> {
  using Array = pilotfish::python::In<Number, Axes>;
  NB_TYPE_CASTER(Array, const_name("numpy.ndarray"))

  bool from_python(handle source, uint8_t flags, cleanup_list* cleanup) noexcept {
    make_caster<pilotfish::python::Given<Number, Axes>> given;
    if (!given.from_python(source, flags & ~uint8_t(cast_flags::convert), cleanup)) return false;
    value = Array(given.value);
    return reinterpret_cast<uintptr_t>(value.data()) % alignof(Number) == 0;
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

// No kernel reads beyond an array, whatever it was given.
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

// Numbers that no kernel is defined for are refused here; kernels/checks.py then names them. Doubles are compared
// as the integers that their bits are, which are in the same order: such a loop vectorises.
constexpr double LARGEST_NUMBER = 1e150;  // as in checks.py: sums of squares do not overflow
constexpr int64_t MAGNITUDE = 0x7fffffffffffffff, INFINITE = 0x7ff0000000000000;  // bits

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

// -inf is a logarithm, NaN and inf are not.
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

inline void expect_threads(int threads) {
  if (threads >= 0) return;
  const std::string is = "threads is " + std::to_string(threads);
  throw nb::value_error((is + ", expected a number, or 0 for all").c_str());
}

}  // namespace pilotfish::python
