#include <algorithm>
#include <bit>
#include <bitr/data.hpp>
#include <map>
#include <mutex>
#include <set>

#include "core/guarded.hpp"
#include "data_sets/order.hpp"
#include "data_sets/part.hpp"
#include "data_sets/shape_cache.hpp"
#include "generate/pairs.hpp"
#include "generate/seeds.hpp"

namespace bitr {
namespace {

using data::AnyShape;
using data::check_range;
using data::Part;
using data::wrong;
using generate::Draw;
using generate::mix;

constexpr std::uint64_t most_attempts = 100;

Result<void> check(const DataOptions& options) {
  if (options.parts.empty()) return wrong("a data set needs at least one part");
  for (const std::size_t points : {options.points_low, options.points_high})
    if (const auto valid = generate::check_points(points); !valid) return valid;
  if (options.points_low > options.points_high || options.points_low < 2)
    return wrong("points is " + std::to_string(options.points_low) + " … " +
                 std::to_string(options.points_high) + ", not a range from 2 on");
  if (const auto valid = check_range("roughness", options.roughness_low, options.roughness_high, 0, 0.1);
      !valid)
    return valid;
  if (!(options.validation_share >= 0 && options.test_share >= 0 &&
        options.validation_share + options.test_share <= 1))
    return wrong("validation and test shares are " + std::to_string(options.validation_share) + " and " +
                 std::to_string(options.test_share) + ", not parts of 1");
  return generate::check({.noise = options.noise, .clip = options.clip, .translation = options.translation});
}

/// Everything the sequence depends on, as numbers and names run together.
std::uint64_t fingerprint_of(const DataOptions& options, const std::vector<Part>& parts) {
  std::uint64_t value = 1;
  const auto add = [&value](std::uint64_t number) { value = mix(value, number); };
  const auto add_real = [&](double number) { add(std::bit_cast<std::uint64_t>(number)); };
  for (const std::uint64_t number :
       {static_cast<std::uint64_t>(options.points_low), static_cast<std::uint64_t>(options.points_high),
        static_cast<std::uint64_t>(options.samples), options.seed,
        static_cast<std::uint64_t>(options.normals), static_cast<std::uint64_t>(options.same_points)})
    add(number);
  for (const double number :
       {options.roughness_low, options.roughness_high, options.noise, options.clip, options.translation})
    add_real(number);
  for (const Part& part : parts) {
    const DataPart& recipe = part.recipe;
    add(recipe.protocol ? 1 + static_cast<std::uint64_t>(*recipe.protocol) : 0);
    for (const double number : {recipe.share_low, recipe.share_high, recipe.weight}) add_real(number);
    add(data::hash(recipe.kind));
    add(recipe.first_seed);
    if (recipe.pool > 0) {
      add(recipe.pool);
      add(part.versions());
      if (part.pools < part.shapes() * part.versions()) add(part.pools);
    }
    add(part.shapes());
    for (const std::uint32_t seed : part.seeds) value = (value ^ seed) * 0x100000001b3ULL;
    for (const std::string& file : part.files) add(data::hash(file));
  }
  return value ? value : 1;
}

std::size_t between(std::size_t low, std::size_t high, Random& random) {
  return low + random.below(high - low + 1);
}

}  // namespace

class DataSet::State {
 public:
  DataOptions options;
  std::vector<Part> parts;
  std::uint64_t samples, fingerprint;

  /// An epoch has `total` samples.
  State(const DataOptions& given, std::vector<Part> opened, std::uint64_t total)
      : options(given),
        parts(std::move(opened)),
        samples(total),
        pool_bytes_(data::share_pools(parts, options.cache_bytes)),
        pools_(pool_bytes_),
        shapes_(options.cache_bytes - pool_bytes_) {
    data::share_out(parts, samples);
    fingerprint = fingerprint_of(options, parts);
  }

  Result<DataSample> sample(std::uint64_t epoch, std::uint64_t index) {
    const std::uint64_t seed = mix(mix(options.seed, epoch), index);
    const std::uint64_t slot = data::shuffled(index, samples, mix(mix(options.seed, 0x65706f6368ULL), epoch));
    std::size_t p = 0;
    while (slot >= parts[p].first_sample + parts[p].samples) ++p;
    const Part& part = parts[p];
    // How often the part has been used, over all epochs, tells how far its shapes' order has come.
    const std::uint64_t use = epoch * part.samples + (slot - part.first_sample), count = part.shapes();
    const std::uint64_t pass = use / count, version = pass % part.versions();
    std::uint64_t shape =
        data::shuffled(use % count, count, mix(mix(mix(options.seed, p), 0x6f72646572ULL), pass));
    Error last;
    for (std::uint64_t attempt = 0; attempt < most_attempts; ++attempt) {
      if (attempt > 0) shape = Random(mix(seed, attempt)).below(count);
      auto drawn = draw({p, shape, version}, seed);
      if (drawn) return drawn;
      last = drawn.error();
    }
    return fail(ErrorCode::bad_file,
                std::to_string(most_attempts) + " shapes in a row cannot be used, the last: " + last.message);
  }

  std::vector<SkippedShape> skipped() {
    const std::lock_guard lock(skipped_mutex_);
    std::set<std::pair<std::string, std::string>> named;
    for (const auto& [key, reason] : skipped_) named.emplace(parts[key.first].name(key.second), reason);
    std::vector<SkippedShape> list;
    for (const auto& [shape, reason] : named) list.push_back({shape, reason});
    return list;
  }

 private:
  struct Key {
    std::size_t part;
    std::uint64_t shape, version;
  };

  Result<std::shared_ptr<const AnyShape>> load(const Key& key) {
    const Part& part = parts[key.part];
    const std::uint64_t version = key.shape * part.versions() + key.version;
    const bool pooled = version < part.pools;
    const std::uint64_t cache_key = key.part << 48 | (pooled ? version : key.shape);
    data::ShapeCache& cache = pooled ? pools_ : shapes_;
    if (auto found = cache.find(cache_key)) return found;
    std::shared_ptr<const AnyShape> loaded;
    if (!part.kind) {
      auto file = data::FileShape::read(part.recipe.folder / part.files[key.shape],
                                        {.points = options.points_high, .normals = options.normals});
      if (!file) return tl::unexpected(file.error());
      loaded = std::make_shared<AnyShape>(std::move(*file));
    } else {
      const std::uint64_t seed = part.recipe.first_seed + part.seeds[key.shape];
      auto shape = generate::make_shape(*part.kind, seed);
      if (pooled)
        loaded = std::make_shared<AnyShape>(data::DensePair(
            draw_uncut(part, *shape, part.recipe.pool, mix(mix(options.seed, seed), key.version))));
      else
        loaded = std::make_shared<AnyShape>(std::move(shape));
    }
    cache.keep(cache_key, loaded);
    return loaded;
  }

  GeneratedPair draw_uncut(const Part& part, const generate::Shape& shape, std::size_t points,
                           std::uint64_t seed) const {
    Random random = generate::random_for(seed, Draw::roughness);
    if (part.origin() == generate::PairOrigin::broken)
      return generate::break_in_two(shape, points,
                                    random.uniform(options.roughness_low, options.roughness_high), seed);
    return generate::sample_twice(shape, points, same_points(part), seed);
  }

  bool same_points(const Part& part) const {
    const generate::PairOrigin origin = part.origin();
    return origin == generate::PairOrigin::copied ||
           (origin == generate::PairOrigin::cropped && options.same_points);
  }

  Result<GeneratedPair> make_pair(const Part& part, const AnyShape& shape, std::uint64_t seed) const {
    Random random = generate::random_for(seed, Draw::recipe);
    const std::size_t points = between(options.points_low, options.points_high, random);
    const double share = random.uniform(part.recipe.share_low, part.recipe.share_high);
    const bool same = same_points(part);
    Result<GeneratedPair> pair;
    if (const auto* file = std::get_if<data::FileShape>(&shape)) {
      pair = file->sample_twice(points, same, seed);
      if (!pair) return pair;
    } else if (const auto* dense = std::get_if<data::DensePair>(&shape)) {
      pair = dense->draw(points, same, seed);
    } else {
      pair = draw_uncut(part, *std::get<0>(shape), points, seed);
    }
    if (part.origin() != generate::PairOrigin::cropped) {
      generate::separate(*pair,
                         {.noise = options.noise,
                          .clip = options.clip,
                          .translation = options.translation,
                          .normals = options.normals},
                         seed);
      return pair;
    }
    const CropOptions crop{.protocol = part.recipe.protocol.value_or(Protocol::opposed),
                           .share = share,
                           .noise = options.noise,
                           .clip = options.clip,
                           .translation = options.translation,
                           .normals = options.normals,
                           .seed = seed};
    auto cropped = same ? crop_pair(pair->source, crop) : crop_pair(pair->source, pair->reference, crop);
    if (cropped) cropped->symmetry = pair->symmetry;
    return cropped;
  }

  Result<DataSample> draw(const Key& key, std::uint64_t seed) {
    const std::pair name(key.part, key.shape);
    {
      const std::lock_guard lock(skipped_mutex_);
      if (const auto known = skipped_.find(name); known != skipped_.end())
        return fail(ErrorCode::bad_file, known->second);
    }
    const auto loaded = load(key);
    if (!loaded) {
      const std::lock_guard lock(skipped_mutex_);
      skipped_.emplace(name, loaded.error().message);
      return tl::unexpected(loaded.error());
    }
    const Part& part = parts[key.part];
    auto pair = make_pair(part, **loaded, seed);
    if (!pair) return tl::unexpected(pair.error());
    return DataSample{std::move(pair->source),
                      std::move(pair->reference),
                      pair->T_reference_source,
                      pair->T_source_object,
                      pair->overlap,
                      part.name(key.shape),
                      pair->symmetry};
  }

  std::size_t pool_bytes_;
  data::ShapeCache pools_, shapes_;
  std::mutex skipped_mutex_;
  std::map<std::pair<std::size_t, std::uint64_t>, std::string> skipped_;  // by part and shape
};

Result<DataSet> DataSet::open(const DataOptions& options) {
  return guarded([&]() -> Result<DataSet> {
    if (const auto valid = check(options); !valid) return tl::unexpected(valid.error());
    std::vector<Part> parts;
    std::uint64_t shapes = 0;
    for (std::size_t i = 0; i < options.parts.size(); ++i) {
      auto part = data::open_part(options.parts[i], options);
      if (!part)
        return fail(part.error().code, "part " + std::to_string(i) + " of the data: " + part.error().message);
      shapes += part->shapes();
      parts.push_back(std::move(*part));
    }
    if (const auto valid = data::check_folders(parts); !valid) return tl::unexpected(valid.error());
    return DataSet(
        std::make_shared<State>(options, std::move(parts), options.samples ? options.samples : shapes));
  });
}

const DataOptions& DataSet::options() const { return state_->options; }
std::size_t DataSet::samples() const { return state_->samples; }
std::uint64_t DataSet::fingerprint() const { return state_->fingerprint; }

std::size_t DataSet::shapes() const {
  std::size_t shapes = 0;
  for (const Part& part : state_->parts) shapes += part.shapes();
  return shapes;
}

Result<DataSample> DataSet::sample(std::uint64_t epoch, std::size_t index) const {
  if (index >= state_->samples)
    return wrong("sample " + std::to_string(index) + " of an epoch of " + std::to_string(state_->samples));
  return guarded([&] { return state_->sample(epoch, index); });
}

std::vector<SkippedShape> DataSet::skipped() const { return state_->skipped(); }

}  // namespace bitr
