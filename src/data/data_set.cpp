#include <algorithm>
#include <bit>
#include <bitr/data.hpp>
#include <bitr/io.hpp>
#include <cmath>
#include <map>
#include <mutex>
#include <numeric>
#include <set>

#include "api/guarded.hpp"
#include "data/order.hpp"
#include "data/shape_cache.hpp"
#include "generate/pairs.hpp"
#include "generate/seeds.hpp"

namespace bitr {
namespace {

using data::AnyShape;
using generate::Draw;
using generate::mix;

constexpr std::size_t most_shapes = 10'000'000;
constexpr std::uint64_t most_attempts = 100;
constexpr std::size_t largest_pool = 1'000'000, most_breaks = 1000;

/// A part's shapes that are in the split.
struct Part {
  DataPart recipe;
  const generate::Kind* kind = nullptr;         ///< null for files
  std::vector<std::uint32_t> seeds;             ///< of a kind, less first_seed
  std::vector<std::string> files;               ///< below the folder, sorted
  std::uint64_t first_sample = 0, samples = 0;  ///< of an epoch in its order
  std::uint64_t pools = 0;                      ///< so many of its shapes' versions, the first, have a pool

  /// How its shapes become pairs.
  generate::Way way() const { return kind && !recipe.protocol ? kind->way : generate::Way::cropped; }
  /// Ways in which a shape is kept.
  std::size_t versions() const {
    return recipe.pool > 0 && way() == generate::Way::broken ? recipe.breaks : 1;
  }
  std::size_t shapes() const { return kind ? seeds.size() : files.size(); }
  std::string name(std::size_t i) const {
    return kind ? std::string(kind->shape) + "/" + std::to_string(recipe.first_seed + seeds[i]) : files[i];
  }
};

bool belongs(Split split, std::string_view name, const DataOptions& options) {
  if (split == Split::all) return true;
  const double at = data::fraction(data::hash(name));
  if (at < options.test_share) return split == Split::test;
  return (at < options.test_share + options.validation_share ? Split::validation : Split::train) == split;
}

std::string without_extension(const std::string& file) {
  return std::filesystem::path(file).replace_extension().generic_string();
}

/// Files that a reader might read, by their paths below the folder, sorted.
Result<std::vector<std::string>> list_files(const std::filesystem::path& folder) {
  std::error_code error;
  std::vector<std::string> files;
  std::filesystem::recursive_directory_iterator entry(folder, error), end;
  while (!error && entry != end) {
    std::error_code gone;
    if (entry->is_regular_file(gone) && io::cloud_format(entry->path()))
      files.push_back(entry->path().lexically_relative(folder).generic_string());
    entry.increment(error);
  }
  if (error) return fail(ErrorCode::io, folder.string() + ": cannot be listed: " + error.message());
  std::sort(files.begin(), files.end());
  return files;
}

tl::unexpected<Error> wrong(const std::string& message) { return fail(ErrorCode::invalid_argument, message); }

Result<void> check_range(const std::string& name, double low, double high, double least, double most) {
  if (low >= least && low <= high && high <= most) return {};
  return wrong(name + " is " + std::to_string(low) + " … " + std::to_string(high) + ", not a range within " +
               std::to_string(least) + " … " + std::to_string(most));
}

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

Result<Part> open_part(const DataPart& recipe, const DataOptions& options) {
  Part part;
  part.recipe = recipe;
  std::size_t total = recipe.shapes;  // in every split
  if (!(recipe.weight > 0 && std::isfinite(recipe.weight)))
    return wrong("weight is " + std::to_string(recipe.weight) + ", not above 0");
  if (const auto valid = check_range("share", recipe.share_low, recipe.share_high, 1e-6, 1); !valid)
    return tl::unexpected(valid.error());
  if (recipe.protocol == Protocol::complement && recipe.share_high == 1)
    return wrong("share goes up to 1, which leaves complement's source nothing");
  if (!recipe.kind.empty()) {
    if (!recipe.folder.empty()) return wrong("it has both a kind and a folder");
    const auto kind = generate::kind_named(recipe.kind);
    if (!kind) return tl::unexpected(kind.error());
    part.kind = *kind;
    if (recipe.pool != 0 && (recipe.pool < options.points_high || recipe.pool > largest_pool))
      return wrong("pool is " + std::to_string(recipe.pool) + ", neither 0 nor in " +
                   std::to_string(options.points_high) + " … " + std::to_string(largest_pool));
    if (recipe.breaks < 1 || recipe.breaks > most_breaks)
      return wrong("breaks is " + std::to_string(recipe.breaks) + ", not in 1 … " +
                   std::to_string(most_breaks));
    if (recipe.shapes < 1 || recipe.shapes > most_shapes)
      return wrong("shapes is " + std::to_string(recipe.shapes) + ", not in 1 … " +
                   std::to_string(most_shapes));
    part.seeds.resize(recipe.shapes);
    std::iota(part.seeds.begin(), part.seeds.end(), 0u);
    if (options.split != Split::all) {
      std::vector<std::uint32_t> kept;
      for (std::size_t i = 0; i < part.seeds.size(); ++i)
        if (belongs(options.split, part.name(i), options)) kept.push_back(part.seeds[i]);
      part.seeds = std::move(kept);
    }
  } else {
    if (recipe.folder.empty()) return wrong("it has neither a kind nor a folder");
    if (recipe.pool != 0) return wrong("pool is for kinds, not for files");
    std::error_code error;
    const bool single =
        std::filesystem::is_regular_file(recipe.folder, error) && io::cloud_format(recipe.folder);
    if (single) part.recipe.folder = std::filesystem::absolute(recipe.folder, error).parent_path();
    auto files = single ? std::vector{recipe.folder.filename().generic_string()} : list_files(recipe.folder);
    if (!files) return tl::unexpected(files.error());
    if (files->empty()) return wrong(recipe.folder.string() + ": no mesh or cloud in it");
    total = files->size();
    for (std::string& file : *files)
      if (belongs(options.split, without_extension(file), options)) part.files.push_back(std::move(file));
  }
  if (part.shapes() == 0)
    return wrong("none of its " + std::to_string(total) + (total == 1 ? " shape" : " shapes") +
                 " falls in the split");
  return part;
}

/// A folder within another would give its shapes two names, and so perhaps two splits.
Result<void> check_folders(const std::vector<Part>& parts) {
  std::set<std::filesystem::path> folders;
  for (const Part& part : parts) {
    std::error_code error;
    if (!part.kind) folders.insert(std::filesystem::canonical(part.recipe.folder, error));
  }
  for (const auto& inner : folders)
    for (auto outer = inner.parent_path(); outer != outer.parent_path(); outer = outer.parent_path())
      if (folders.contains(outer))
        return wrong(inner.string() + " lies in " + outer.string() + ", another part");
  return {};
}

/// Shares `total` samples out by weight: the largest remainders get what is left over.
void share_out(std::vector<Part>& parts, std::uint64_t total) {
  double weight = 0;
  for (const Part& part : parts) weight += part.recipe.weight;
  std::vector<std::pair<double, std::size_t>> remainders;
  std::uint64_t left = total;
  for (std::size_t i = 0; i < parts.size(); ++i) {
    const double exact = static_cast<double>(total) * (parts[i].recipe.weight / weight);
    parts[i].samples = std::min(left, static_cast<std::uint64_t>(exact));
    left -= parts[i].samples;
    remainders.emplace_back(static_cast<double>(parts[i].samples) - exact, i);
  }
  std::sort(remainders.begin(), remainders.end());
  for (std::size_t i = 0; left > 0; i = (i + 1) % parts.size(), --left) ++parts[remainders[i].second].samples;
  std::uint64_t first = 0;
  for (Part& part : parts) {
    part.first_sample = first;
    first += part.samples;
  }
}

/// Gives pools to as many shapes as fit in the cache: to make one again each time would take longer than to
/// draw without. Returns the bytes they take.
std::size_t share_pools(std::vector<Part>& parts, std::size_t bytes) {
  const auto wanted = [](const Part& part) {
    return part.recipe.pool > 0 ? static_cast<double>(part.shapes()) * static_cast<double>(part.versions())
                                : 0;
  };
  double needed = 0;
  for (const Part& part : parts)
    needed += wanted(part) * static_cast<double>(data::DensePair::bytes_of(part.recipe.pool));
  const double share = std::min(1.0, static_cast<double>(bytes) / std::max(needed, 1.0));
  std::size_t taken = 0;
  for (Part& part : parts) {
    part.pools = static_cast<std::uint64_t>(share * wanted(part));
    taken += part.pools * data::DensePair::bytes_of(part.recipe.pool);
  }
  return std::min(taken, bytes);
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

  /// Of an epoch of `total` samples.
  State(const DataOptions& given, std::vector<Part> opened, std::uint64_t total)
      : options(given),
        parts(std::move(opened)),
        samples(total),
        pool_bytes_(share_pools(parts, options.cache_bytes)),
        pools_(pool_bytes_),
        shapes_(options.cache_bytes - pool_bytes_) {
    share_out(parts, samples);
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
    if (part.way() == generate::Way::broken)
      return generate::break_in_two(shape, points,
                                    random.uniform(options.roughness_low, options.roughness_high), seed);
    return generate::sample_twice(shape, points, same_points(part), seed);
  }

  bool same_points(const Part& part) const {
    const generate::Way way = part.way();
    return way == generate::Way::copied || (way == generate::Way::cropped && options.same_points);
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
    if (part.way() != generate::Way::cropped) {
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
      auto part = open_part(options.parts[i], options);
      if (!part)
        return fail(part.error().code, "part " + std::to_string(i) + " of the data: " + part.error().message);
      shapes += part->shapes();
      parts.push_back(std::move(*part));
    }
    if (const auto valid = check_folders(parts); !valid) return tl::unexpected(valid.error());
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
