#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "core/turn.hpp"
#include "cpu/kernel.hpp"

namespace bitr::cpu {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using RowMatrix3 = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

// Which inputs there are.
enum : int { estimate_input, truth_input, keys_input };

template <int Size, class T>
Eigen::Matrix<double, Size, 1> row_of(const Slot& slot, std::size_t row) {
  return Eigen::Map<const Eigen::Matrix<T, Size, 1>>(slot.as<T>() + row * slot.stride())
      .template cast<double>();
}

// The true pose nearest to an estimate of the rotation, whatever its length.
struct Truth {
  Truth(const Eigen::Matrix<double, ops::truth_width, 1>& row, const Matrix3d& estimate)
      : R(Eigen::Map<const RowMatrix3>(row.data())), t(row.segment<3>(9)) {
    const Vector3d axis = row.segment<3>(12), centre = row.segment<3>(15);
    std::array<double, 9> A;
    Eigen::Map<RowMatrix3>(A.data()) = R.transpose() * estimate;
    const double angle = nearest_turn(A, {axis[0], axis[1], axis[2]}, row[18]);
    const Matrix3d S = Eigen::AngleAxisd(angle, axis).toRotationMatrix();
    t += R * (centre - S * centre);
    R = R * S;
  }
  Matrix3d R;
  Vector3d t;
};

// Each term: value, and the gradient with respect to the estimate's row.
struct Terms {
  double rotation = 0, translation = 0;
};

using TruthRow = Eigen::Matrix<double, ops::truth_width, 1>;

Terms official(const Eigen::Matrix<double, ops::pose_width, 1>& pose, const TruthRow& row,
               Eigen::Matrix<double, ops::pose_width, 1>* gradient) {
  const Matrix3d R = Eigen::Map<const RowMatrix3>(pose.data());
  const Truth truth(row, R);
  const Matrix3d rotation = truth.R * R.transpose() - Matrix3d::Identity();
  const Vector3d translation = truth.t - pose.segment<3>(9);
  if (gradient) {
    gradient->setZero();
    Eigen::Map<RowMatrix3>(gradient->data()) = 2.0 / 9 * rotation.transpose() * truth.R;
    gradient->segment<3>(9) = -2.0 / 3 * translation;
  }
  return {rotation.squaredNorm() / 9, translation.squaredNorm() / 3};
}

// A term of the rotation's squared error, and its derivative.
struct RotationTerm {
  double value = 0, slope = 0;
};

RotationTerm rotation_term(ops::LossKind kind, double square) {
  if (kind == ops::LossKind::direct) {
    const double slope = ops::direct_rotation_weight / 9;
    return {slope * square, slope};
  }
  const double root = std::sqrt(square + ops::robust_softening);
  return {ops::robust_rotation_weight * root, ops::robust_rotation_weight / (2 * root)};
}

// The kinds that project nothing.
Terms unprojected(ops::LossKind kind, const Eigen::Matrix<double, ops::piece_count, 1>& pieces,
                  const TruthRow& row, Eigen::Matrix<double, ops::piece_count, 1>* gradient) {
  const Matrix3d r = Eigen::Map<const RowMatrix3>(pieces.data()).transpose();
  const Truth truth(row, r);
  const double length = r.norm(), norm = std::max(length, ops::matrix_norm_floor);
  const Matrix3d error = r / norm - truth.R / std::sqrt(3.0);
  const Vector3d first = pieces.segment<3>(9) + pieces.segment<3>(15),
                 second = pieces.segment<3>(12) + pieces.segment<3>(18);
  const Vector3d off = second - truth.R * first - truth.t;
  const double distance = std::sqrt(off.squaredNorm() + ops::direct_softening);
  const RotationTerm rotation = rotation_term(kind, error.squaredNorm());
  if (gradient) {
    Matrix3d along = 2 * rotation.slope / norm * error;
    if (length >= ops::matrix_norm_floor) along -= along.cwiseProduct(r).sum() / (norm * norm) * r;
    Eigen::Map<RowMatrix3>(gradient->data()) = along.transpose();
    const Vector3d pull = off / distance;
    gradient->segment<3>(9) = gradient->segment<3>(15) = -truth.R.transpose() * pull;
    gradient->segment<3>(12) = gradient->segment<3>(18) = pull;
  }
  return {rotation.value, distance};
}

// One cloud's spread; keys: 3 × K. `gradient`, of the keys' shape, is added to.
double spread(const Eigen::Matrix3Xd& keys, Eigen::Matrix3Xd* gradient) {
  double sum = 0;
  const double share = -ops::spread_weight / static_cast<double>(keys.cols() * keys.cols());
  for (Eigen::Index a = 0; a < keys.cols(); ++a)
    for (Eigen::Index b = 0; b < keys.cols(); ++b) {
      const Vector3d apart = keys.col(a) - keys.col(b);
      const double distance = apart.lpNorm<1>();
      sum += std::min(distance, ops::spread_reach);
      if (!gradient || distance > ops::spread_reach) continue;
      const Vector3d sign = apart.unaryExpr([](double x) { return double(x > 0) - double(x < 0); });
      gradient->col(a) += share * sign;
      gradient->col(b) -= share * sign;
    }
  return share * sum;
}

template <class T>
Eigen::Matrix3Xd keys_of(const Arguments& args, std::uint32_t cloud) {
  const std::size_t keys = args.layout.key_points;
  return Eigen::Map<const Eigen::Matrix<T, 3, Eigen::Dynamic>>(args.in[keys_input].as<T>() + 3 * cloud * keys,
                                                               3, static_cast<Eigen::Index>(keys))
      .template cast<double>();
}

// The terms that depend on the estimate; its gradient goes to `to` where that is not null.
template <class T, int Width, class Term>
Terms pose_terms(const Arguments& args, std::uint32_t pair, Term term, double share, T* to) {
  Eigen::Matrix<double, Width, 1> gradient;
  const Terms terms = term(row_of<Width, T>(args.in[estimate_input], pair),
                           row_of<ops::truth_width, T>(args.in[truth_input], pair), to ? &gradient : nullptr);
  if (to) Eigen::Map<Eigen::Matrix<T, Width, 1>>(to + pair * Width) = (share * gradient).template cast<T>();
  return terms;
}

template <class T>
Terms pose_terms(const Arguments& args, ops::LossKind kind, std::uint32_t pair, double share = 0,
                 T* to = nullptr) {
  if (kind == ops::LossKind::official) return pose_terms<T, ops::pose_width>(args, pair, official, share, to);
  return pose_terms<T, ops::piece_count>(
      args, pair,
      [kind](const auto& pieces, const TruthRow& row, auto* gradient) {
        return unprojected(kind, pieces, row, gradient);
      },
      share, to);
}

template <class T>
class LossKernel : public Kernel<T> {
 public:
  explicit LossKernel(const ops::Loss& op) : op_(op) {}

  void run(const Arguments& args) const override {
    const std::uint32_t pairs = args.layout.pairs();
    for (std::uint32_t pair = 0; pair < pairs; ++pair) {
      const Terms terms = pose_terms<T>(args, op_.kind, pair);
      T* out = args.out[0].as<T>() + pair * ops::loss_terms;
      out[0] = static_cast<T>(terms.rotation);
      out[1] = static_cast<T>(terms.translation);
      out[2] = static_cast<T>(spread(keys_of<T>(args, pair), nullptr) +
                              spread(keys_of<T>(args, pair + pairs), nullptr));
    }
  }

 private:
  const ops::Loss op_;
};

template <class T>
class LossGradient : public Kernel<T> {
 public:
  explicit LossGradient(const ops::Gradient<ops::Loss>& op) : op_(op) {}

  void run(const Arguments& args) const override {
    const GradientSlots<ops::Loss> slots{op_, args};
    const double share = 1.0 / args.layout.pairs();
    if (const Slot* to = slots.grad_input(estimate_input))
      for (std::uint32_t pair = 0; pair < args.layout.pairs(); ++pair)
        pose_terms<T>(args, op_.op.kind, pair, share, to->as<T>());
    if (const Slot* to = slots.grad_input(keys_input))
      for (std::uint32_t cloud = 0; cloud < args.layout.clouds(); ++cloud) {
        const Eigen::Matrix3Xd keys = keys_of<T>(args, cloud);
        Eigen::Matrix3Xd gradient = Eigen::Matrix3Xd::Zero(3, keys.cols());
        spread(keys, &gradient);
        Eigen::Map<Eigen::Matrix<T, 3, Eigen::Dynamic>>(to->as<T>() + 3 * cloud * keys.cols(), 3,
                                                        keys.cols()) = (share * gradient).cast<T>();
      }
  }

 private:
  const ops::Gradient<ops::Loss> op_;
};

}  // namespace

template <>
KernelPtr<float> make_kernel(const ops::Loss& op) {
  return std::make_unique<LossKernel<float>>(op);
}
template <>
KernelPtr<double> make_kernel(const ops::Loss& op) {
  return std::make_unique<LossKernel<double>>(op);
}

template <>
KernelPtr<float> make_kernel(const ops::Gradient<ops::Loss>& op) {
  return std::make_unique<LossGradient<float>>(op);
}
template <>
KernelPtr<double> make_kernel(const ops::Gradient<ops::Loss>& op) {
  return std::make_unique<LossGradient<double>>(op);
}

}  // namespace bitr::cpu
