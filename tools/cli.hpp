// The command-line parser by name: most units only hand an app on.
#pragma once

namespace CLI {
class App;
class Option;
}  // namespace CLI
