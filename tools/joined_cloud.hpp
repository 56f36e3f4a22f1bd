// The picture of a result: both clouds in the reference's frame.
#pragma once

#include <bitr/assemble.hpp>
#include <bitr/cloud.hpp>
#include <bitr/pose.hpp>
#include <optional>

#include "output.hpp"

namespace bitr::tool {

/// The source moved by the pose, then the reference. Colours are the inputs' when both have them, else orange
/// for the source and blue for the reference; normals are kept, turned with their points, when every
/// point has one.
PointCloud joined_cloud(const PointCloud& source, const PointCloud& reference,
                        const Pose& T_reference_source);

/// Both clouds before and after, as the bytes of a PNG file.
Result<Bytes> picture_of(const PointCloud& source, const PointCloud& reference, const Assembly& assembly,
                         std::optional<double> confidence);

}  // namespace bitr::tool
