# Headers of the standard library and of dependencies that nearly every unit reads, parsed once. Our own headers are
# not among them: they change. The sources include what they use all the same; -DCMAKE_DISABLE_PRECOMPILE_HEADERS=ON
# shows that.
set(BITR_PRECOMPILED <algorithm> <array> <cmath> <cstdint> <filesystem> <functional> <map> <memory> <optional> <set>
                     <span> <string> <variant> <vector> <Eigen/Dense> <nlohmann/json.hpp> <tl/expected.hpp>)

# bitr_exact(SOURCE...): sources of the library whose results are the same whether the machine fuses a product and a sum or
# not. They have no precompiled headers: with them GCC forgets the option without a word.
function(bitr_exact)
  set_source_files_properties(${ARGN} TARGET_DIRECTORY bitr PROPERTIES
                              COMPILE_OPTIONS -ffp-contract=off SKIP_PRECOMPILE_HEADERS ON)
endfunction()
