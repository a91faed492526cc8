#include "rank_one.hpp"

#include <algorithm>
#include <cmath>

namespace pilotfish {

namespace {

constexpr double EPS = std::numeric_limits<double>::epsilon();
constexpr int MAX_ITERATIONS = 100;  // bisection alone would need 64

}  // namespace

void RankOne::reserve(int n) {
  if (int(d_.size()) >= n) return;
  for (Buffer* buffer : {&d_, &z_, &pole_, &weight_, &shift_, &true_z_, &vector_, &all_}) buffer->resize(n);
  gap_.resize(size_t(n) * n);
  kept_.resize(n);
  order_.resize(n);
  rotations_.reserve(n);
}

// Deflation: writes to kept_ the indices of the m poles that remain; the others are eigenvalues already.
int RankOne::deflate(int n) {
  double square = 0.0;
  for (int i = 0; i < n; ++i) square += z_[i] * z_[i];
  const double tiny = 8.0 * EPS * std::max(d_[0], square), length = std::sqrt(square);
  rotations_.clear();
  int m = 0;
  for (int i = 0; i < n; ++i) {
    if (std::abs(z_[i]) * length <= tiny) {
      z_[i] = 0.0;
      continue;
    }
    if (m > 0) {
      const int before = kept_[m - 1];
      const double difference = d_[before] - d_[i], squares = z_[before] * z_[before] + z_[i] * z_[i];
      if (!(difference * std::abs(z_[before] * z_[i]) >
            tiny * squares)) {  // rotate: z of the former becomes zero
        const double r = std::hypot(z_[before], z_[i]), c = z_[i] / r, s = z_[before] / r;
        rotations_.push_back({before, i, c, s});
        z_[i] = r;
        z_[before] = 0.0;
        const double upper = d_[before], lower = d_[i];
        d_[before] = upper * c * c + lower * s * s;
        d_[i] = upper * s * s + lower * c * c;
        kept_[m - 1] = i;
        continue;
      }
    }
    kept_[m++] = i;
  }
  return m;
}

// Computes the roots above poles k to k + 3, as far as they exist: shift_[k], and in row k of gap_ the
// distances of the poles from it. Each lane is one root. A step goes to the root of 1 + p + q / (left - x) +
// r + s / (right - x), which has the same values and slopes as the sums over the poles below and above.
void RankOne::roots(int k, int m) {
  const int lanes_used = std::min(4, m - k);
  double total = 0.0;
  for (int j = 0; j < m; ++j) total += weight_[j];
  Lanes<4> own, above_own, w_own, w_above, first = Lanes<4>::Zero();
  for (int lane = 0; lane < 4; ++lane) {
    const int at = k + std::min(lane, lanes_used - 1);
    own[lane] = pole_[at];
    above_own[lane] = at ? pole_[at - 1] : pole_[0] + total;
    w_own[lane] = weight_[at];
    w_above[lane] = at ? weight_[at - 1] : 0.0;
    if (at == 0) first[lane] = 1.0;
  }
  Lanes<4> half = 0.5 * (above_own - own);
  if (k == 0) half[0] = 0.5 * total;  // exact, also if adding the pole would round
  Lanes<4> middle = Lanes<4>::Ones();
  for (int j = 0; j < m; ++j) middle += weight_[j] / ((pole_[j] - own) - half);
  // Initial value: root with the two nearest poles exact and the other terms as at the midpoint (quadratic
  // equation).
  const Lanes<4> rest = middle + (w_own - w_above) / half;
  const Lanes<4> linear = 2.0 * half * rest + w_own + w_above, constant = 2.0 * half * w_own;
  const Lanes<4> apart = (linear * linear - 4.0 * rest * constant).max(0.0).sqrt();
  const Lanes<4> guess = 2.0 * constant / (linear + apart), far_guess = (linear - apart) / (2.0 * rest);
  Lanes<4> origin, low, high, x;
  for (int lane = 0; lane < 4; ++lane) {
    const bool up = middle[lane] < 0.0 && first[lane] == 0.0;
    origin[lane] = up ? above_own[lane] : own[lane];
    low[lane] = up ? -half[lane] : 0.0;
    high[lane] = up ? 0.0 : (first[lane] == 0.0 ? half[lane] : 2.0 * half[lane]);
    x[lane] = (linear[lane] >= 0.0 ? guess : far_guess)[lane] - (origin[lane] - own[lane]);
    if (first[lane] != 0.0) x[lane] = std::min(weight_[0], half[lane]);
    if (!(x[lane] > low[lane] && x[lane] < high[lane])) x[lane] = 0.5 * (low[lane] + high[lane]);
  }
  const Lanes<4> left = own - origin, right = above_own - origin;
  bool found[4] = {false, false, false, false};
  for (int step = 0, open = 4; step < MAX_ITERATIONS && open > 0; ++step) {
    Lanes<4> below = Lanes<4>::Zero(), above = below, slope_below = below, slope_above = below;
    for (int j = 0; j < m; ++j) {
      const Lanes<4> inverse = 1.0 / ((pole_[j] - origin) - x), term = weight_[j] * inverse;
      const Lanes<4> under = term.min(0.0), over = term.max(0.0);
      below += under;
      above += over;
      slope_below += under * inverse;
      slope_above += over * inverse;
    }
    const Lanes<4> f = 1.0 + below + above, error = 2.0 * EPS * m * (1.0 - below + above);
    const Lanes<4> a = left - x, b = right - x, q = slope_below * a * a, s = slope_above * b * b;
    const Lanes<4> c = f - slope_below * a - slope_above * b;
    // The step t from x solves c t^2 - B t + C = 0.
    const Lanes<4> B = c * (a + b) + q + s, C = c * a * b + q * b + s * a;
    const Lanes<4> root = (B * B - 4.0 * c * C).max(0.0).sqrt();
    const Lanes<4> stable = 2.0 * C / (B + root), other = (B - root) / (2.0 * c);
    const Lanes<4> alone = left + q / (1.0 + below - slope_below * a);
    for (int lane = 0; lane < 4; ++lane) {
      if (found[lane]) continue;
      if (std::abs(f[lane]) <= error[lane]) {
        found[lane] = true;
        --open;
        continue;
      }
      (f[lane] < 0.0 ? low : high)[lane] = x[lane];
      double next = x[lane] + (B[lane] >= 0.0 ? stable[lane] : other[lane]);
      if (first[lane] != 0.0) next = alone[lane];
      if (!(next > low[lane] && next < high[lane])) next = 0.5 * (low[lane] + high[lane]);
      if (next == x[lane] || !(high[lane] > low[lane])) {
        found[lane] = true;
        --open;
        continue;
      }
      x[lane] = next;
    }
  }
  for (int lane = 0; lane < lanes_used; ++lane) {
    shift_[k + lane] = origin[lane] + x[lane];
    double* gap = &gap_[size_t(k + lane) * m];
    for (int j = 0; j < m; ++j) gap[j] = (pole_[j] - origin[lane]) - x[lane];
  }
}

// Writes the eigenvector of root k to a column.
void RankOne::put_vector(int k, int column, int m, int width, double* R) {
  const double* gap = &gap_[size_t(k) * m];
  double square = 0.0;
  for (int j = 0; j < m; ++j) {
    vector_[j] = true_z_[j] / gap[j];
    square += vector_[j] * vector_[j];
  }
  const double scale = 1.0 / std::sqrt(square);
  for (int j = 0; j < m; ++j) R[size_t(kept_[j]) * width + column] = scale * vector_[j];
}

void RankOne::vectors(int n, int m, int width, double* values, double* R) {
  for (int j = 0; j < m; ++j) {  // |z_j|^2 = prod (value_k - pole_j) / prod (pole_k - pole_j)
    double square = -gap_[size_t(j) * m + j];
    for (int k = 0; k < m; ++k)
      if (k != j) square *= gap_[size_t(k) * m + j] / (pole_[j] - pole_[k]);
    true_z_[j] = std::copysign(std::sqrt(std::max(square, 0.0)), z_[kept_[j]]);
  }
  if (m == n) {  // the usual case: roots are in decreasing order
    for (int column = 0; column < n; ++column) {
      values[column] = std::max(shift_[column], 0.0);
      put_vector(column, column, m, width, R);
    }
    for (int i = 0; i < n; ++i) std::fill_n(R + size_t(i) * width + n, width - n, 0.0);
    return;
  }
  for (int i = 0; i < n; ++i) {
    order_[i] = i;
    all_[i] = d_[i];
  }
  for (int k = 0; k < m; ++k) all_[kept_[k]] = shift_[k];
  std::sort(order_.begin(), order_.begin() + n, [&](int a, int b) { return all_[a] > all_[b]; });
  std::fill_n(R, size_t(n) * width, 0.0);
  for (int column = 0; column < n; ++column) {
    const int own = order_[column];
    values[column] = std::max(all_[own], 0.0);
    const int* place = std::find(kept_.data(), kept_.data() + m, own);
    if (place == kept_.data() + m) {
      R[size_t(own) * width + column] = 1.0;
      continue;
    }
    put_vector(int(place - kept_.data()), column, m, width, R);
  }
  for (size_t t = rotations_.size(); t-- > 0;) {
    const Rotation& rotation = rotations_[t];
    double *row_i = R + size_t(rotation.i) * width, *row_j = R + size_t(rotation.j) * width;
    for (int column = 0; column < n; ++column) {
      const double u = row_i[column], v = row_j[column];
      row_i[column] = rotation.c * u + rotation.s * v;
      row_j[column] = rotation.c * v - rotation.s * u;
    }
  }
}

void RankOne::solve(const double* poles, const double* z, int n, int width, double* values, double* R) {
  reserve(n);
  std::copy_n(poles, n, d_.data());
  std::copy_n(z, n, z_.data());
  const int m = deflate(n);
  for (int k = 0; k < m; ++k) {
    pole_[k] = d_[kept_[k]];
    weight_[k] = z_[kept_[k]] * z_[kept_[k]];
  }
  for (int k = 0; k < m; k += 4) roots(k, m);
  vectors(n, m, width, values, R);
}

}  // namespace pilotfish
