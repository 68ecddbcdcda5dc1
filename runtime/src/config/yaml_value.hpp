// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "config/config.hpp"
#include "config/config_values.hpp"

#include <yaml-cpp/yaml.h>

#include <functional>
#include <map>
#include <string>
#include <string_view>
#include <utility>

namespace cles::runtime {

/// Where values come from.
struct yaml_source {
    std::string name;                            ///< of the file, the environment variable or the flag
    std::map<std::string, std::string>& origins; ///< receives the locations of all values that are read
    bool is_file = true;                         ///< messages name the key
};

/// A value of the configuration, with its full key and its line, so that messages can name them. All functions may
/// throw config_error.
class yaml_value {
  public:
    using reader = std::function<void(const yaml_value&)>;
    using readers = std::map<std::string_view, reader>;

    /// \param source has to outlive this
    yaml_value(const YAML::Node& value, std::string key, const yaml_source& source);

    [[nodiscard]] bool is_scalar() const { return value_.IsScalar(); }
    [[nodiscard]] bool is_list() const { return value_.IsSequence(); }
    [[nodiscard]] const std::string& scalar() const;
    /// The scalar, converted by a function that may throw invalid_value.
    template <class F>
    auto as(F convert) const {
        return checked([&] { return convert(scalar()); });
    }
    /// The result of a function that may throw invalid_value because of this value.
    template <class F>
    auto checked(F read) const {
        try {
            return read();
        } catch (const invalid_value& e) {
            fail(e.what());
        }
    }

    /// Passes the value of each key to the key's reader. Keys without a reader are errors.
    void read_map(const readers& known) const;
    /// The same for a map whose keys are node names.
    void read_names(const std::function<void(const std::string&, const yaml_value&)>& each) const;
    void read_list(const reader& each) const;
    /// The value as JSON. Records the locations of everything it contains.
    [[nodiscard]] std::string json() const;

    [[noreturn]] void fail(const std::string& why) const;

  private:
    void for_each_pair(const std::function<void(const std::string&, const yaml_value&)>& each) const;
    [[nodiscard]] std::string location() const;
    void record_locations(const YAML::Node& value, const std::string& key) const;

    YAML::Node value_;
    std::string key_;
    const yaml_source& source_;
};

/// The settings of a plugin as JSON: a map or a list; null becomes `{}`. Unquoted scalars that are a number, true,
/// false or null in JSON become that; all others become strings. \throws invalid_value if the value is neither, is
/// nested deeper than 32 levels, or exceeds 1 MiB
std::string yaml_to_json(const YAML::Node& value);

} // namespace cles::runtime
