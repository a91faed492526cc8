#include "impedance.hpp"

#include <Eigen/Core>
#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

namespace pilotfish {

namespace {

using Vector3 = Eigen::Vector3d;
using Vector6 = Eigen::Matrix<double, 6, 1>;
using Matrix6 = Eigen::Matrix<double, 6, 6>;
using Joints = Eigen::Matrix<double, Eigen::Dynamic, 1, Eigen::ColMajor, MAX_JOINTS, 1>;
using Jacobian = Eigen::Matrix<double, 6, Eigen::Dynamic, Eigen::RowMajor, 6, MAX_JOINTS>;

Eigen::Map<const Joints> joints(const double* values, int n) { return {values, n}; }
Eigen::Map<const Vector6> six(const double* values) { return Eigen::Map<const Vector6>(values); }
Eigen::Map<const Vector3> three(const double* values) { return Eigen::Map<const Vector3>(values); }

Joints finite(Joints values) {
  for (double& one : values)
    if (!std::isfinite(one)) one = 0.0;
  return values;
}

// The rotation vector of q p^-1 in world axes, of q or -q the nearer one; not a number where one is zero.
Vector3 turn_to(const double* p, const double* q) {
  const auto from = three(p + 1), to = three(q + 1);
  const double w = p[0] * q[0] + from.dot(to);
  const Vector3 vector = p[0] * to - q[0] * from - to.cross(from);
  const double sine = std::sqrt(vector.squaredNorm());
  if (!(std::abs(w) + sine > 0.0)) return Vector3::Constant(std::numeric_limits<double>::quiet_NaN());
  const double angle = 2.0 * std::atan2(sine, std::abs(w));
  return vector * (sine > 0.0 ? std::copysign(angle / sine, w) : 0.0);
}

// Force and moment no longer than their limits; not a number where a norm is not finite.
Vector6 shortened(const Arm& arm, Vector6 wrench) {
  const double force = std::sqrt(wrench.head<3>().squaredNorm());
  const double moment = std::sqrt(wrench.tail<3>().squaredNorm());
  if (!std::isfinite(force + moment)) return Vector6::Constant(std::numeric_limits<double>::quiet_NaN());
  wrench.head<3>() *= std::min(1.0, arm.force_limit / force);
  wrench.tail<3>() *= std::min(1.0, arm.moment_limit / moment);
  return wrench;
}

Vector6 wrench_of(const Arm& arm, const Jacobian& J) {
  Vector6 error;
  error << three(arm.target_position) - three(arm.position), turn_to(arm.quaternion, arm.target_quaternion);
  const Vector6 spring = shortened(arm, six(arm.stiffness).cwiseProduct(error));
  const Vector6 slip = J * joints(arm.velocity, arm.n) - six(arm.twist);
  return shortened(arm, spring - six(arm.damping).cwiseProduct(slip));
}

// J^T F + (I - J^T J^+T) k_q (q_neutral - q), false when it or F is not finite.
bool task_of(const Arm& arm, Vector6& F, Joints& task) {
  const Jacobian J = Eigen::Map<const Jacobian>(arm.jacobian, 6, arm.n);
  F = wrench_of(arm, J);
  const Matrix6 gram = J * J.transpose();
  if (!F.allFinite() || !gram.allFinite()) return false;
  const Eigen::SelfAdjointEigenSolver<Matrix6> solver(gram);  // squared singular values of J
  const Joints posture = arm.posture_stiffness * (joints(arm.posture, arm.n) - joints(arm.q, arm.n));
  const Vector6 values = solver.eigenvalues().cwiseMax(arm.min_singular_value * arm.min_singular_value);
  const Vector6 along = solver.eigenvectors().transpose() * (J * posture);
  const Vector6 pseudo = solver.eigenvectors() * along.cwiseQuotient(values);  // J^+T posture
  task = J.transpose() * (F - pseudo) + posture;
  return task.allFinite();
}

Joints off_limits(const Arm& arm) {
  const auto q = joints(arm.q, arm.n);
  Joints push(arm.n);
  for (int i = 0; i < arm.n; ++i) {
    const double below = arm.lower[i] + arm.limit_margin - q[i];
    const double above = q[i] - (arm.upper[i] - arm.limit_margin);
    push[i] = arm.limit_stiffness * (std::max(below, 0.0) - std::max(above, 0.0));
  }
  return push;
}

// torque = bias + push, each cut to its limit, and the least share of its push that a joint could give; see
// kernels/arms.py.
double within(const Arm& arm, const Joints& bias, const Joints& push, double* torque) {
  double run_groups = 1.0;
  for (int i = 0; i < arm.n; ++i) {
    const double limit = arm.torque[i], wanted = bias[i] + push[i];
    torque[i] = std::min(std::max(wanted, -limit), limit);
    if (torque[i] == wanted) continue;
    const double carried = std::min(std::max(bias[i], -limit), limit);
    run_groups = std::min(run_groups, push[i] == 0.0 ? 0.0 : (torque[i] - carried) / push[i]);
  }
  return run_groups;
}

}  // namespace

double impedance(const Arm& arm, double* torque, double* wrench) {
  Joints push = finite(off_limits(arm)) - finite(arm.joint_damping * joints(arm.velocity, arm.n));
  Vector6 F;
  Joints task(arm.n);
  if (!task_of(arm, F, task)) {
    F.setZero();
    task.setZero();
  }
  Eigen::Map<Vector6>{wrench} = F;
  return within(arm, finite(joints(arm.bias, arm.n)), finite(push + task), torque);
}

}  // namespace pilotfish
