#include "shape_files.hpp"

#include "data_sets/part.hpp"

namespace bitr::tool {

Result<InputFiles> shape_files(const std::string& path) {
  const auto part = data::open_part({.folder = path}, {});
  if (!part) return tl::unexpected(part.error());
  InputFiles files;
  for (const std::string& file : part->files) files.add(part->recipe.folder / file);
  return files;
}

}  // namespace bitr::tool
