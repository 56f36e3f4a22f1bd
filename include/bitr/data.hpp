// Endless samples for training, and repeatable ones for validation and tests: pairs of clouds with their
// truth, drawn from procedural shapes and from folders of meshes and clouds.
#pragma once

#include <bitr/cloud.hpp>
#include <bitr/generate.hpp>
#include <bitr/pose.hpp>
#include <bitr/result.hpp>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace bitr {

/// Shapes are divided, never crops of them: a hash of a shape's name alone ("aircraft/17", or a file's path
/// below its folder without the extension) decides which part it falls in, whatever else is in the data set.
enum class Split { all, train, validation, test };

/// One ingredient of a data set: a kind of procedural shapes or a folder, and how pairs are made of them.
struct DataPart {
  std::string kind = {};        ///< one of generated_kinds(); empty: files
  std::size_t shapes = 10'000;  ///< a kind's seeds are first_seed … first_seed + shapes − 1, up to 10 million
  std::uint64_t first_seed = 0;       ///< with a kind
  std::filesystem::path folder = {};  ///< without a kind: searched with all folders below it for what
                                      ///< read_geometry reads; or one such file

  /// With a kind, to draw samples more quickly: so many points of each side (each fragment, or each of two
  /// samples of the shape) are drawn once, in single precision, and every sample takes some of them. At least
  /// points_high, up to a million; 0: every sample is drawn anew. A pool takes 48 bytes for each of its
  /// points; shapes whose pools do not fit in the cache do without.
  std::size_t pool = 0;
  std::size_t breaks = 4;  ///< with a pool: ways in which a shape is broken, one for each time it comes
                           ///< round, 1 … 1000; without: endless

  std::optional<Protocol> protocol = {};     ///< empty: the kind's own way; opposed for files
  double share_low = 0.7, share_high = 0.7;  ///< a crop's share is uniform between them
  double weight = 1;                         ///< share of all samples, relative to the other parts'; above 0
};

/// Lengths are in model units: every shape is centred and fits in a ball of radius 0.5, files too (their
/// bounding box's middle goes to the origin, their furthest point to 0.5).
struct DataOptions {
  std::vector<DataPart> parts;
  Split split = Split::all;
  double validation_share = 0.1, test_share = 0.1;  ///< shares of the shapes

  std::size_t points_low = 1024, points_high = 1024;  ///< as GenerateOptions::points, uniform between them
  double roughness_low = 0.02,
         roughness_high = 0.02;         ///< as GenerateOptions::roughness, uniform between them
  double noise = 0, clip = noise_clip;  ///< as in CropOptions
  double translation = 1;               ///< as in CropOptions
  bool normals = true;                  ///< shapes without normals are skipped; false: no sample has normals
  bool same_points = false;             ///< both sides crop one sample of the surface; false: each its own

  std::size_t samples = 0;  ///< samples an epoch; 0: as many as there are shapes in the split
  std::uint64_t seed = 0;
  std::size_t cache_bytes = std::size_t{256} << 20;  ///< memory for shapes that will be used again; the
                                                     ///< samples depend on it only if pools do not fit
};

struct DataSample {
  PointCloud source, reference;
  Pose T_reference_source;
  Pose T_source_object;  ///< see GeneratedPair
  double overlap = 0;    ///< see GeneratedPair
  std::string shape;     ///< its name
  Symmetry symmetry;     ///< see GeneratedPair; files count as having none
};

/// A shape that cannot be used.
struct SkippedShape {
  std::string shape;
  std::string reason;  ///< one line
};

/// A list of shapes and a rule that makes sample i of epoch e of them: the same whenever, in whatever order
/// and on however many threads it is asked for. Within an epoch a part gives its samples evenly: each of its
/// shapes is used once before any is used again, in an order that is new each time, and that goes on over the
/// epochs.
///
/// A copy refers to the same data set. All calls may be made from several threads at once.
class DataSet {
 public:
  /// Lists files but reads none. `invalid_argument` when an option is out of its range, a kind is unknown, a
  /// part has no shape in the split, or one part's folder lies inside another's (their shapes could be
  /// divided differently); `io` when a folder cannot be listed.
  static Result<DataSet> open(const DataOptions& options);

  const DataOptions& options() const;
  std::size_t samples() const;  ///< in an epoch
  std::size_t shapes() const;   ///< in the split

  /// Changes when anything does that the sequence depends on, but for the files' content.
  std::uint64_t fingerprint() const;

  /// index < samples(). A shape that cannot be used is replaced by another of its part and counted;
  /// `bad_file` when 100 in a row cannot.
  Result<DataSample> sample(std::uint64_t epoch, std::size_t index) const;

  /// Those found out so far, each once, by name.
  std::vector<SkippedShape> skipped() const;

 private:
  class State;
  explicit DataSet(std::shared_ptr<State> state) : state_(std::move(state)) {}
  std::shared_ptr<State> state_;
};

/// A place in the sequence, to be kept with a training run.
struct DataPosition {
  std::uint64_t epoch = 0, index = 0;  ///< where the next sample is
  std::uint64_t fingerprint = 0;       ///< its data set's; 0: not known
};

struct SamplerOptions {
  unsigned threads = 1;    ///< that draw ahead; 0: samples are drawn when they are asked for
  std::size_t ahead = 64;  ///< samples drawn ahead at most, at least 1
  DataPosition start = {};
};

/// The samples one after the other, epoch after epoch, drawn ahead by threads of its own. Which samples come
/// does not depend on how many threads there are.
class Sampler {
 public:
  /// `invalid_argument` when the position is of another data set or beyond its epoch, or `ahead` is 0.
  static Result<Sampler> start(const DataSet& data, const SamplerOptions& options = {});
  Sampler(Sampler&&) noexcept;
  Sampler& operator=(Sampler&&) noexcept;
  ~Sampler();

  /// The next sample, waiting for it if need be; or why there is none, and the one after it next time.
  Result<DataSample> next();
  /// Where to start for what next() would give now.
  DataPosition position() const;

 private:
  class Queue;
  explicit Sampler(std::unique_ptr<Queue> queue);
  std::unique_ptr<Queue> queue_;
};

}  // namespace bitr
