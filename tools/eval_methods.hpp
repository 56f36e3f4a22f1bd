// The ways to find a pose that bitr eval compares.
#pragma once

#include <bitr/assemble.hpp>
#include <bitr/data.hpp>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace bitr::tool {

enum class Way { identity, principal_axes, network };

struct Method {
  std::string name;
  Way way = Way::identity;
  bool plain = false;    ///< a row of its poses
  bool refined = false;  ///< a row "name+icp" of its poses after trimmed ICP

  // Of a network.
  std::string file = {};  ///< empty for complete-match
  std::optional<Model> model = {};
  std::optional<Plan> plan = {};  ///< made when it is needed
};

struct MethodChoice {
  std::vector<std::string> models;    ///< files
  std::vector<std::string> controls;  ///< see control_names, each perhaps with "+icp"
  bool icp = false;                   ///< a refined row for every model
  std::optional<Mode> mode = {};      ///< overrides the models'
};

inline constexpr std::string_view control_names = "identity, pca-icp, complete-match";

/// Models first, then controls; all controls when nothing is chosen. Names differ: models of one name go by
/// their paths. The error names what is wrong.
Result<std::vector<Method>> choose_methods(const MethodChoice& choice);

/// How estimates are made, whatever the method.
struct Estimation {
  const Device& device;
  std::optional<Mode> mode;
  double keep;  ///< as in refine::IcpOptions
};

/// T_reference_source of every sample.
Result<std::vector<Pose>> estimate(Method& method, std::span<const DataSample> batch, const Estimation& how);
/// Each pose after ICP; one that is not finite stays.
std::vector<Pose> refined(const std::vector<Pose>& poses, std::span<const DataSample> batch,
                          const Estimation& how);

}  // namespace bitr::tool
