#include "data_sets/part.hpp"

#include <algorithm>
#include <bitr/io.hpp>
#include <cmath>
#include <numeric>
#include <set>

#include "data_sets/dense_pair.hpp"
#include "data_sets/order.hpp"

namespace bitr::data {
namespace {

constexpr std::size_t most_shapes = 10'000'000;
constexpr std::size_t largest_pool = 1'000'000, most_breaks = 1000;

bool belongs(Split split, std::string_view name, const DataOptions& options) {
  if (split == Split::all) return true;
  const double at = fraction(hash(name));
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

}  // namespace

tl::unexpected<Error> wrong(const std::string& message) { return fail(ErrorCode::invalid_argument, message); }

Result<void> check_range(const std::string& name, double low, double high, double least, double most) {
  if (low >= least && low <= high && high <= most) return {};
  return wrong(name + " is " + std::to_string(low) + " … " + std::to_string(high) + ", not a range within " +
               std::to_string(least) + " … " + std::to_string(most));
}

bool is_cropped(const DataPart& part) {
  if (part.protocol || part.kind.empty()) return true;
  const auto kind = generate::kind_named(part.kind);
  return kind && (*kind)->origin == generate::PairOrigin::cropped;
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

std::size_t share_pools(std::vector<Part>& parts, std::size_t bytes) {
  const auto wanted = [](const Part& part) {
    return part.recipe.pool > 0 ? static_cast<double>(part.shapes()) * static_cast<double>(part.versions())
                                : 0;
  };
  double needed = 0;
  for (const Part& part : parts)
    needed += wanted(part) * static_cast<double>(DensePair::bytes_of(part.recipe.pool));
  const double share = std::min(1.0, static_cast<double>(bytes) / std::max(needed, 1.0));
  std::size_t taken = 0;
  for (Part& part : parts) {
    part.pools = static_cast<std::uint64_t>(share * wanted(part));
    taken += part.pools * DensePair::bytes_of(part.recipe.pool);
  }
  return std::min(taken, bytes);
}

}  // namespace bitr::data
