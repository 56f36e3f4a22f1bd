#include "pair_list.hpp"

#include <bitr/io.hpp>

#include "api/plan.hpp"
#include "core/centroid.hpp"
#include "core/random.hpp"
#include "generate/pairs.hpp"
#include "manifest.hpp"
#include "pose_file.hpp"
#include "refine/overlap.hpp"

namespace bitr::tool {
namespace {

constexpr std::size_t mesh_points = 20'000;

}  // namespace

Result<PairList> PairList::open(const std::string& path) {
  auto manifest = Manifest::open(path);
  if (!manifest) return tl::unexpected(manifest.error());
  PairList list;
  for (;;) {
    const auto next = manifest->next();
    if (!next) return tl::unexpected(next.error());
    if (!*next) break;
    const ManifestEntry& entry = **next;
    for (const std::string* file : {&entry.source, &entry.reference, &entry.truth}) list.files_.add(*file);
    const auto truth = read_optional_pose(entry.truth);
    if (!truth) return tl::unexpected(truth.error());
    if (!*truth && !entry.pose)
      return fail(ErrorCode::bad_file, path + ": " + entry.name + " has no truth to be compared with");
    Known known{entry.name, {}, {}, *truth ? **truth : *entry.pose};
    io::ReadOptions read{.mesh_points = mesh_points, .seed = 2 * entry.number};
    for (const auto& [file, cloud] :
         {std::pair(&entry.source, &known.source), {&entry.reference, &known.reference}}) {
      auto made = io::read_cloud(*file, read);
      if (!made) return tl::unexpected(made.error());
      *cloud = std::move(*made);
      if (cloud->normals.empty()) list.without_normals_ = *file;
      ++read.seed;
    }
    list.pairs_.push_back(std::move(known));
  }
  if (list.pairs_.empty()) return fail(ErrorCode::bad_file, path + ": holds no pairs");
  return list;
}

DataSample PairList::sample(std::size_t index, std::size_t points, std::uint64_t seed) const {
  const Known& known = pairs_[index % pairs_.size()];
  Random random(seed * 0x9e3779b97f4a7c15ULL + index);
  DataSample sample;
  sample.shape = known.name;
  sample.source = io::subsample(known.source, points, random.bits());
  sample.reference = io::subsample(known.reference, points, random.bits());
  const CloudPair as_given = {sample.source, sample.reference};
  sample.overlap = refine::overlap_at(as_given, known.T_reference_source, {});
  Pose T_source_object;
  T_source_object.translation = centroid_of(sample.source.positions);
  const Pose source_motion = generate::random_pose(diagonal(sample.source.positions), random),
             reference_motion = generate::random_pose(diagonal(sample.reference.positions), random);
  generate::move(sample.source, source_motion);
  generate::move(sample.reference, reference_motion);
  sample.T_reference_source = reference_motion * known.T_reference_source * source_motion.inverse();
  sample.T_source_object = source_motion * T_source_object;
  return sample;
}

}  // namespace bitr::tool
