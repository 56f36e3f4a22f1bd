#include "manifest.hpp"

// GCC takes its cutting names short for an accident.
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wstringop-truncation"
#define CSV_IO_NO_THREAD
#include <libfccp/csv.h>
#pragma GCC diagnostic pop

#include <filesystem>
#include <fstream>

#include "core/hash.hpp"
#include "io/formats.hpp"
#include "pose_file.hpp"

namespace bitr::tool {

class Manifest::Lines {
 public:
  Lines(const std::string& path, std::ifstream file)
      : path_(path), folder_(std::filesystem::path(path).parent_path()), file_(std::move(file)) {}
  virtual ~Lines() = default;

  Result<std::optional<ManifestEntry>> next() {
    ManifestEntry entry;
    entry.number = number_;
    const auto read = read_line(entry);
    if (!read) {
      ++number_;
      return fail(read.error().code,
                  path_ + ", line " + std::to_string(line()) + ": " + read.error().message);
    }
    if (!*read) return std::nullopt;
    ++number_;
    for (const auto& [key, value] : {std::pair("source", &entry.source), {"reference", &entry.reference}})
      if (value->empty())
        return fail(ErrorCode::bad_file,
                    path_ + ", line " + std::to_string(line()) + ": names no " + std::string(key));
    if (entry.name.empty()) entry.name = "pair " + std::to_string(entry.number);
    for (std::string* file : {&entry.source, &entry.reference, &entry.truth})
      if (!file->empty()) *file = (folder_ / *file).string();
    return entry;
  }

 protected:
  /// Whether there was one; errors without file and line.
  virtual Result<bool> read_line(ManifestEntry& entry) = 0;
  virtual std::uint64_t line() const = 0;
  std::ifstream& file() { return file_; }

 private:
  std::string path_;
  std::filesystem::path folder_;
  std::ifstream file_;
  std::uint64_t number_ = 0;
};

namespace {

// Without the file's name, which the caller knows whole.
std::string reason(const ::io::error::base& error) {
  std::string text = error.what();
  for (const char* from : {" in line ", " in file "})
    if (const auto at = text.rfind(from); at != std::string::npos) text.resize(at);
  return text;
}

class Table : public Manifest::Lines {
 public:
  Table(const std::string& path, std::ifstream opened)
      : Lines(path, std::move(opened)), reader_(path, file()) {
    constexpr auto columns = ::io::ignore_missing_column | ::io::ignore_extra_column;
    reader_.read_header(columns, "source", "reference", "truth", "name");
  }
  bool has(const char* column) const { return reader_.has_column(column); }

 protected:
  Result<bool> read_line(ManifestEntry& entry) override {
    try {
      return reader_.read_row(entry.source, entry.reference, entry.truth, entry.name);
    } catch (const ::io::error::base& error) {
      return fail(ErrorCode::bad_file, reason(error));
    }
  }
  std::uint64_t line() const override { return reader_.get_file_line(); }

 private:
  ::io::CSVReader<4, ::io::trim_chars<' ', '\t'>, ::io::double_quote_escape<',', '"'>,
                  ::io::throw_on_overflow, ::io::empty_line_comment>
      reader_;
};

class JsonLines : public Manifest::Lines {
 public:
  using Lines::Lines;

 protected:
  Result<bool> read_line(ManifestEntry& entry) override {
    std::string text;
    do {
      if (!std::getline(file(), text)) return false;
      ++line_;
    } while (text.find_first_not_of(" \t\r") == std::string::npos);
    const Json json = Json::parse(text, nullptr, false);
    if (!json.is_object()) return fail(ErrorCode::bad_file, "is no JSON object");
    for (const auto& [key, value] : {std::pair("source", &entry.source),
                                     {"reference", &entry.reference},
                                     {"truth", &entry.truth},
                                     {"name", &entry.name}}) {
      const auto found = json.find(key);
      if (found == json.end() || found->is_null()) continue;
      if (!found->is_string()) return fail(ErrorCode::bad_file, "\"" + std::string(key) + "\" is no text");
      *value = found->get<std::string>();
    }
    if (const auto matrix = json.find("T_reference_source"); matrix != json.end()) {
      const auto pose = parse_pose(*matrix, "\"T_reference_source\"");
      if (!pose) return tl::unexpected(pose.error());
      entry.pose = *pose;
    }
    return true;
  }
  std::uint64_t line() const override { return line_; }

 private:
  std::uint64_t line_ = 0;
};

}  // namespace

Manifest::Manifest(std::unique_ptr<Lines> lines) : lines_(std::move(lines)) {}
Manifest::Manifest(Manifest&&) noexcept = default;
Manifest& Manifest::operator=(Manifest&&) noexcept = default;
Manifest::~Manifest() = default;

Result<Manifest> Manifest::open(const std::string& path) {
  std::error_code error;
  if (std::filesystem::is_directory(path, error)) return fail(ErrorCode::io, path + ": is a folder");
  std::ifstream file(path, std::ios::binary);
  if (!file) return fail(ErrorCode::io, path + ": cannot be read");
  const std::string extension = io::extension_of(path);
  if (extension == ".jsonl" || extension == ".ndjson" || extension == ".json")
    return Manifest(std::make_unique<JsonLines>(path, std::move(file)));
  try {
    auto table = std::make_unique<Table>(path, std::move(file));
    for (const char* column : {"source", "reference"})
      if (!table->has(column))
        return fail(ErrorCode::bad_file,
                    path + ": its first line names no column \"" + std::string(column) + "\"");
    return Manifest(std::move(table));
  } catch (const ::io::error::base& thrown) {
    return fail(ErrorCode::bad_file, path + ": " + reason(thrown));
  }
}

Result<std::optional<ManifestEntry>> Manifest::next() { return lines_->next(); }

Result<ManifestSummary> summarise_manifest(const std::string& path) {
  auto manifest = Manifest::open(path);
  if (!manifest) return tl::unexpected(manifest.error());
  ManifestSummary summary;
  for (;; ++summary.pairs)
    if (const auto entry = manifest->next(); entry && !*entry) break;
  std::ifstream file(path, std::ios::binary);
  summary.fingerprint = fnv1a_start;
  for (std::vector<char> block(1 << 16); file.read(block.data(), block.size()), file.gcount() > 0;)
    summary.fingerprint = fnv1a(std::as_bytes(std::span(block).first(file.gcount())), summary.fingerprint);
  return summary;
}

}  // namespace bitr::tool
