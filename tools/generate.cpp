// bitr generate: pairs of clouds with a known answer.
#include <bitr/generate.hpp>
#include <bitr/io.hpp>
#include <iostream>
#include <memory>

#include "command.hpp"
#include "options.hpp"
#include "output.hpp"

namespace bitr::tool {
namespace {

struct Options {
  std::string kind, folder;
  io::PlyEncoding encoding = io::PlyEncoding::binary_little_endian;
  std::uint64_t count = 1, seed = 0, points = 2048;
  GenerateOptions pair;
};

std::string numbered(const std::string& kind, std::uint64_t index) {
  std::string digits = std::to_string(index);
  if (digits.size() < 3) digits.insert(0, 3 - digits.size(), '0');
  return kind + "_" + digits;
}

Json truth_json(const GeneratedPair& pair, const std::string& kind, const std::string& name,
                const GenerateOptions& options) {
  return {{"kind", kind},
          {"seed", options.seed},
          {"points", options.points},
          {"noise", options.noise},
          {"roughness", options.roughness},
          {"source", name + "_source.ply"},
          {"reference", name + "_reference.ply"},
          {"T_reference_source", matrix_json(pair.T_reference_source)}};
}

int run(Options& options) {
  options.pair.points = options.points;
  const std::filesystem::path folder = options.folder;
  for (std::uint64_t i = 0; i < options.count; ++i) {
    options.pair.seed = options.seed + i;
    const auto pair = generate_pair(options.kind, options.pair);
    if (!pair) return complain(pair.error());
    if (i == 0) {
      std::error_code error;
      std::filesystem::create_directories(folder, error);
      if (!std::filesystem::is_directory(folder))
        return complain(bad_usage, "--out " + options.folder + ": cannot be made: " + error.message());
    }
    const std::string name = numbered(options.kind, i);
    auto written = io::write_ply(folder / (name + "_source.ply"), pair->source, options.encoding);
    if (written)
      written = io::write_ply(folder / (name + "_reference.ply"), pair->reference, options.encoding);
    if (written)
      written =
          write_json(folder / (name + "_truth.json"), truth_json(*pair, options.kind, name, options.pair));
    if (!written) return complain(written.error());
    show_progress(std::to_string(i + 1) + " of " + std::to_string(options.count));
  }
  clear_progress();
  std::cout << options.count << (options.count == 1 ? " pair" : " pairs") << " in " << options.folder << ", "
            << numbered(options.kind, 0) << "_{source,reference}.ply with _truth.json"
            << (options.count > 1 ? " and so on" : "") << '\n';
  return done;
}

}  // namespace

Command add_generate(CLI::App& root) {
  auto options = std::make_shared<Options>();
  CLI::App* app = root.add_subcommand("generate", "Make pairs of clouds with a known answer");
  std::string kinds;
  for (const GeneratedKind& kind : generated_kinds())
    kinds += "  " + std::string(kind.name) + std::string(12 - kind.name.size(), ' ') +
             std::string(kind.summary) + "\n";
  app->add_option("KIND", options->kind, "What to make, see below")->required();
  app->add_option("--out", options->folder, "Folder to write to; made if it is missing")
      ->required()
      ->type_name("DIR");
  add_count(*app, "--count", options->count, 1, 1'000'000, "Pairs to make");
  add_seed(*app, "--seed", options->seed, "Seed of the first pair; pair i takes seed + i");
  add_count(*app, "--points", options->points, 1, max_generated_points, "Points of each cloud");
  app->add_option("--noise", options->pair.noise, "Standard deviation added to every coordinate")
      ->type_name("LENGTH")
      ->capture_default_str();
  app->add_option("--roughness", options->pair.roughness, "Standard deviation of a break's relief")
      ->type_name("LENGTH")
      ->capture_default_str();
  add_choice<io::PlyEncoding>(
      *app, "--format",
      {{"ply", io::PlyEncoding::binary_little_endian}, {"ply-ascii", io::PlyEncoding::ascii}},
      options->encoding, "Encoding of the clouds")
      ->default_str("ply");
  app->footer(
      "Kinds (every object fits in a ball of radius 0.5):\n" + kinds +
      "\nPair 0 of KIND is KIND_000_source.ply, KIND_000_reference.ply and KIND_000_truth.json, which has\n"
      "the pose T_reference_source: x_reference = R x_source + t.\n\n"
      "Example:\n"
      "  bitr generate fragments --out clouds --count 10 --seed 1 --points 4096");
  return {app, [options] { return run(*options); }};
}

}  // namespace bitr::tool
