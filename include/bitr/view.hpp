// A page to turn an assembly around in: one HTML file that needs nothing but a browser, and no network.
#pragma once

#include <bitr/assemble.hpp>
#include <bitr/cloud.hpp>
#include <bitr/result.hpp>
#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

namespace bitr {

struct ViewOptions {
  std::string source_name = "source", reference_name = "reference";  ///< shown; any bytes
  std::string report = "{}";  ///< a JSON object that the page shows beside the clouds, whatever its keys
  /// Poses beside the assembly's own that the page flips through, and what it calls each of them. With any, the
  /// first name is the assembly's.
  std::vector<Pose> alternatives = {};
  std::vector<std::string> names = {};  ///< one more than alternatives, or none
  /// Points shown of a cloud, above 0; larger ones are thinned evenly over the surface, and the page says so.
  std::size_t most_points = 200'000;
};

/// Whether this library has the page: it is built from viewer/, where the packages of that folder are
/// installed.
bool has_view();

/// Both clouds in the reference's frame, the source where a slider between "as given" and "assembled" puts
/// it: turned about the centre of its box, which goes straight to its place. Clouds given far apart start
/// closer, and the page says so. Same input, same page.
///
/// `unsupported` without has_view(); `invalid_argument` as render_picture, when colours are not one per
/// point, the report is no JSON object, names and alternatives do not agree, or most_points is 0.
Result<std::string> render_view(const PointCloud& source, const PointCloud& reference,
                                const Assembly& assembly, const ViewOptions& options = {});

/// render_view, io::write_file: the file appears whole or not at all.
Result<void> write_view(const std::filesystem::path& path, const PointCloud& source,
                        const PointCloud& reference, const Assembly& assembly,
                        const ViewOptions& options = {});

}  // namespace bitr
