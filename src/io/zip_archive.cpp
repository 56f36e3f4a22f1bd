#include "io/zip_archive.hpp"

#include <zip.h>

#include "io/quote.hpp"

namespace bitr::io {
namespace {

constexpr std::uint64_t deflate_ratio = 1032;  // 258 bytes from two bits is the most the format can do

struct CloseFile {
  void operator()(zip_file_t* file) const { zip_fclose(file); }
};

std::string text_of(zip_error_t* error) {
  const std::string text = zip_error_strerror(error);
  zip_error_fini(error);
  return text;
}

}  // namespace

void ZipArchive::Close::operator()(zip* archive) const { zip_discard(archive); }

Result<ZipArchive> ZipArchive::open(std::span<const std::byte> bytes) {
  ZipArchive opened;
  opened.budget_ = 16 * std::uint64_t{bytes.size()} + (1 << 20);
  zip_error_t error;
  zip_error_init(&error);
  zip_source_t* source = zip_source_buffer_create(bytes.data(), bytes.size(), 0, &error);
  if (source) opened.archive_.reset(zip_open_from_source(source, ZIP_RDONLY | ZIP_CHECKCONS, &error));
  if (!opened.archive_) {
    zip_source_free(source);
    return fail(ErrorCode::bad_file, "not a zip archive: " + text_of(&error));
  }
  zip_error_fini(&error);
  return opened;
}

std::vector<std::string> ZipArchive::paths() const {
  std::vector<std::string> found;
  const zip_int64_t count = zip_get_num_entries(archive_.get(), 0);
  for (zip_int64_t i = 0; i < count; ++i) {
    const char* path = zip_get_name(archive_.get(), static_cast<zip_uint64_t>(i), ZIP_FL_ENC_RAW);
    if (path) found.emplace_back(path);
  }
  return found;
}

bool ZipArchive::contains(const std::string& path) const {
  return zip_name_locate(archive_.get(), path.c_str(), ZIP_FL_ENC_RAW) >= 0;
}

Result<std::vector<std::byte>> ZipArchive::read(const std::string& path) {
  const auto refuse = [&](const std::string& why) {
    return fail(ErrorCode::bad_file, "entry " + in_quotes(path) + why);
  };
  const zip_int64_t index = zip_name_locate(archive_.get(), path.c_str(), ZIP_FL_ENC_RAW);
  if (index < 0) return refuse(" is missing");
  zip_stat_t about;
  zip_stat_init(&about);
  constexpr zip_uint64_t needed =
      ZIP_STAT_SIZE | ZIP_STAT_COMP_SIZE | ZIP_STAT_COMP_METHOD | ZIP_STAT_ENCRYPTION_METHOD;
  if (zip_stat_index(archive_.get(), static_cast<zip_uint64_t>(index), 0, &about) != 0 ||
      (about.valid & needed) != needed) {
    return refuse(" has no size");
  }
  if (about.encryption_method != ZIP_EM_NONE) return refuse(" is encrypted");
  if (about.comp_method != ZIP_CM_STORE && about.comp_method != ZIP_CM_DEFLATE) {
    return refuse(": compression method " + std::to_string(about.comp_method) +
                  " is neither stored nor deflate");
  }
  const bool stored = about.comp_method == ZIP_CM_STORE;
  if (stored ? about.size != about.comp_size : about.size / deflate_ratio > about.comp_size) {
    return refuse(" cannot unpack " + std::to_string(about.comp_size) + " bytes to " +
                  std::to_string(about.size));
  }
  if (about.size > budget_) {
    return refuse(" unpacks to " + std::to_string(about.size) + " bytes, limit " + std::to_string(budget_));
  }
  budget_ -= about.size;

  const std::unique_ptr<zip_file_t, CloseFile> file(
      zip_fopen_index(archive_.get(), static_cast<zip_uint64_t>(index), 0));
  if (!file) return refuse(std::string(": ") + zip_strerror(archive_.get()));
  std::vector<std::byte> bytes(about.size);
  // One byte more than declared: only at the entry's end does the library compare the CRC.
  std::byte more{};
  if (zip_fread(file.get(), bytes.data(), bytes.size()) != static_cast<zip_int64_t>(bytes.size()) ||
      zip_fread(file.get(), &more, 1) != 0) {
    return refuse(std::string(" is damaged: ") + zip_file_strerror(file.get()));
  }
  return bytes;
}

}  // namespace bitr::io
