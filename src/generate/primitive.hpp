// What compounds are put together from: closed surfaces over a grid of parameters, each with a test of what
// is inside it.
#pragma once

#include <Eigen/Core>
#include <array>
#include <functional>
#include <vector>

namespace bitr::generate {

class Primitive {
 public:
  virtual ~Primitive() = default;
  virtual bool contains(const Eigen::Vector3d& at) const = 0;
  /// The surface over [0, rows()] × [0, columns()]; smooth within each cell, closed over the columns and at
  /// both ends. by_column × by_row points outwards.
  struct Place {
    Eigen::Vector3d at, by_row, by_column;  ///< and its derivatives
  };
  virtual Place place(double row, double column) const = 0;
  /// Where the corners of the cells are, row by row.
  virtual std::vector<Eigen::Vector3d> corners() const = 0;

  int rows() const { return static_cast<int>(rings_.size()) - 1; }
  int columns() const { return columns_; }

 protected:
  /// A place along the part, and how far from its middle to its outline: flat ends are rings that shrink.
  struct Ring {
    double along, scale;
  };
  Primitive(const std::vector<double>& stations, int columns);
  Ring ring(double row) const;
  Ring ring_step(double row) const;  ///< to the next row's
  double angle(double column) const;

 private:
  std::vector<Ring> rings_;
  int columns_;
};

/// A cut through a loft.
struct Section {
  double u = 0, v = 0;            ///< its middle
  double half_u = 0, half_v = 0;  ///< half of its extents
  double beak = 0;                ///< how much further it reaches towards +u, as a share: a lip to pour from
};

enum class Outline {
  round,    ///< an ellipse
  airfoil,  ///< the symmetric NACA section, its leading edge towards +u
};

/// Sections in parallel planes, one after the other along an axis.
class Loft : public Primitive {
 public:
  using Cut = std::function<Section(double along)>;
  /// `axis` and `u` are perpendicular unit vectors. `stations`: where the grid's rows are, from end to end.
  Loft(const Eigen::Vector3d& axis, const Eigen::Vector3d& u, Outline outline, Cut cut,
       const std::vector<double>& stations, int columns);

  bool contains(const Eigen::Vector3d& at) const override;
  Place place(double row, double column) const override;
  std::vector<Eigen::Vector3d> corners() const override;

 private:
  /// A place on the outline of a section with half extents of 1, and its derivatives by the angle.
  struct Unit {
    double p, q, by_angle_p, by_angle_q;
  };
  Unit unit(double beak, double turn) const;
  Eigen::Vector3d at(const Ring& ring, const Section& section, const Unit& unit) const;

  Eigen::Vector3d axis_, u_, v_;
  Outline outline_;
  Cut cut_;
  double first_, last_;
};

/// An elliptic tube along a cubic Bézier curve that lies in a plane.
class Bow : public Primitive {
 public:
  struct Tube {
    std::array<Eigen::Vector3d, 4> curve;  ///< its control points
    Eigen::Vector3d across;                ///< unit normal of their plane
    std::array<double, 2> half_in,
        half_across;  ///< half of its thickness in the plane and across, from end to end
  };
  explicit Bow(const Tube& tube);

  bool contains(const Eigen::Vector3d& at) const override;
  Place place(double row, double column) const override;
  std::vector<Eigen::Vector3d> corners() const override;

 private:
  Eigen::Vector3d point(double t) const;
  Eigen::Vector3d velocity(double t) const;
  Eigen::Vector3d acceleration(double t) const;
  Tube tube_;
  std::vector<Eigen::Vector3d> path_;  ///< points along the curve
};

/// `count` + 1 numbers from `low` to `high`, equally far apart.
std::vector<double> even_steps(double low, double high, int count);
/// The same, closer together towards `low`: for ends that are round there.
std::vector<double> steps_from_tip(double low, double high, int count);
/// One run of steps after the other; where they meet the place is kept once.
std::vector<double> joined(std::initializer_list<std::vector<double>> runs);

}  // namespace bitr::generate
