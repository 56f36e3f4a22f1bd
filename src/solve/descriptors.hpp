// What the surface around a point looks like, whatever the frame.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "core/thread_pool.hpp"
#include "solve/normals.hpp"

namespace bitr::solving {

inline constexpr int descriptor_bins = 11, descriptor_size = 3 * descriptor_bins;
/// One column per point.
using Descriptors = Eigen::Matrix<float, descriptor_size, Eigen::Dynamic>;

/// Fast point feature histograms (Rusu, Blodow & Beetz, 2009) at several radii: of three angles between the
/// normals of a point and those around it, and of the neighbours' histograms, nearer ones counting more. Square
/// roots of shares, so that distances are Hellinger's.
std::vector<Descriptors> describe(const Level& level, const Neighbours& near,
                                  const std::vector<Vec3d>& normals, std::span<const double> radii,
                                  ThreadPool& pool);

/// Those of the same surface seen from its other side: all normals flipped.
Descriptors flipped(const Descriptors& descriptors);

}  // namespace bitr::solving
