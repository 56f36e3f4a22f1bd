// Pickles put together by hand, opcode by opcode, and zip archives around them.
#pragma once

#include <zip.h>

#include <cstdint>
#include <initializer_list>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

namespace bitr::test {

/// A count of `width` bytes, little-endian.
inline std::string count_bytes(std::uint64_t value, int width) {
  std::string bytes;
  for (int i = 0; i < width; ++i) bytes += static_cast<char>(value >> 8 * i);
  return bytes;
}

inline const std::string proto("\x80\x02", 2);

inline std::string unicode(std::string_view value) {
  return std::string("X").append(count_bytes(value.size(), 4)).append(value);
}

inline std::string integer(std::int32_t value) {
  return std::string("J").append(count_bytes(static_cast<std::uint32_t>(value), 4));
}

inline std::string wide(std::int64_t value) {
  return std::string("\x8a\x08", 2) + count_bytes(static_cast<std::uint64_t>(value), 8);
}

inline std::string global(std::string_view module, std::string_view member) {
  return std::string("c").append(module).append("\n").append(member).append("\n");
}

inline std::string tuple(std::initializer_list<std::string> items) {
  std::string bytes = "(";
  for (const std::string& item : items) bytes += item;
  return bytes + "t";
}

inline std::string integers(std::initializer_list<std::int64_t> values) {
  std::string bytes = "(";
  for (const std::int64_t value : values) bytes += wide(value);
  return bytes + "t";
}

inline const std::string ordered_dict = global("collections", "OrderedDict") + ")R";

inline std::string storage(std::string_view type, std::string_view key, std::int64_t size) {
  return tuple({unicode("storage"), global("torch", type), unicode(key), unicode("cpu"), wide(size)}) + "Q";
}

inline std::string tensor(const std::string& source, std::int64_t offset,
                          std::initializer_list<std::int64_t> shape,
                          std::initializer_list<std::int64_t> strides) {
  return global("torch._utils", "_rebuild_tensor_v2") +
         tuple({source, wide(offset), integers(shape), integers(strides), "\x89", ordered_dict}) + "R";
}

inline std::string parameter(const std::string& data) {
  return global("torch._utils", "_rebuild_parameter") + tuple({data, "\x88", ordered_dict}) + "R";
}

struct ZipEntry {
  std::string path;
  std::string content;
  zip_int32_t method = ZIP_CM_STORE;
};

inline std::string zip_of(const std::vector<ZipEntry>& entries) {
  zip_error_t error;
  zip_error_init(&error);
  zip_source_t* target = zip_source_buffer_create(nullptr, 0, 0, &error);
  zip_source_keep(target);
  zip_t* archive = zip_open_from_source(target, ZIP_TRUNCATE, &error);
  if (!archive) throw std::runtime_error("cannot start an archive");
  for (const ZipEntry& entry : entries) {
    zip_source_t* source = zip_source_buffer(archive, entry.content.data(), entry.content.size(), 0);
    const zip_int64_t index = zip_file_add(archive, entry.path.c_str(), source, ZIP_FL_ENC_UTF_8);
    if (index < 0) throw std::runtime_error("cannot add " + entry.path);
    zip_set_file_compression(archive, static_cast<zip_uint64_t>(index), entry.method, 0);
    zip_file_set_mtime(archive, static_cast<zip_uint64_t>(index), 315532800, 0);
  }
  if (zip_close(archive) != 0) throw std::runtime_error("cannot finish the archive");
  zip_stat_t about;
  zip_stat_init(&about);
  zip_source_stat(target, &about);
  std::string bytes(about.size, '\0');
  zip_source_open(target);
  zip_source_read(target, bytes.data(), bytes.size());
  zip_source_close(target);
  zip_source_free(target);
  return bytes;
}

}  // namespace bitr::test
