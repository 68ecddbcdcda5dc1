// SPDX-License-Identifier: BSL-1.0
#include "config/config_file.hpp"

#include <cles/json_writer.hpp>
#include <cles/limit_ranges.hpp>

#include "config/config.hpp"
#include "config/config_values.hpp"
#include "config/yaml_value.hpp"
#include "system/whole_file.hpp"

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <functional>
#include <map>
#include <optional>
#include <sstream>
#include <string_view>
#include <system_error>
#include <type_traits>
#include <vector>

namespace cles::runtime {
namespace {

constexpr std::size_t max_file_size = 1U << 20U;

// -- values from YAML ----------------------------------------------------------------------------------------------

// The following four make functions that return what they read. \param to converts text
template <class F>
auto scalar(F to) {
    return [=](const yaml_value& from) { return from.as(to); };
}

// A single string may be written without brackets.
template <class F>
auto list(F to) {
    return [=](const yaml_value& from) {
        std::vector<std::string> all;
        if (from.is_scalar()) {
            all.push_back(from.as(to));
        } else {
            from.read_list([&](const yaml_value& item) { all.push_back(item.as(to)); });
        }
        return all;
    };
}

// A map whose keys are names of nodes.
template <class F>
auto by_name(F to) {
    return [=](const yaml_value& from) {
        std::map<std::string, std::string> all;
        from.read_names([&](const std::string& name, const yaml_value& value) { all[name] = value.as(to); });
        return all;
    };
}

auto count(std::uint32_t min, std::uint32_t max) {
    return scalar([=](const std::string& text) { return static_cast<std::uint32_t>(to_count(text, min, max)); });
}

// Reads a part of a value.
template <class T, class F>
yaml_value::reader part(T& to, F read) {
    return [&to, read](const yaml_value& from) { to = static_cast<T>(read(from)); };
}

// One string with commas, or a list.
std::string interfaces_of(const yaml_value& from) {
    if (from.is_scalar()) {
        return from.as(to_interfaces);
    }
    std::string all;
    from.read_list([&](const yaml_value& item) { all += (all.empty() ? "" : ",") + item.as(to_interfaces); });
    return from.checked([&] { return to_interfaces(all); });
}

multicast_options multicast_of(const yaml_value& from) {
    if (from.is_scalar()) {
        return from.as(to_multicast);
    }
    const auto to_group = [](const std::string& group) { return to_multicast("lo," + group + ":1").group; };
    multicast_options read{.interface = "lo"};
    if (from.is_list()) {
        read.interface = interfaces_of(from);
        return read;
    }
    from.read_map({{"interface", part(read.interface, interfaces_of)},
                   {"group", part(read.group, scalar(to_group))},
                   {"port", part(read.port, count(1, 65535))},
                   {"required", part(read.required, scalar(to_bool))}});
    return read;
}

void read_log(const yaml_value& from, log_config& into) {
    if (from.is_scalar()) {
        into = from.as([&](const std::string& text) { return to_log_config(text, into); });
        return;
    }
    from.read_map(
        {{"level", part(into.level, scalar(to_log_level))}, {"format", part(into.format, scalar(to_log_format))}});
}

security_config security_of(const yaml_value& from) {
    const auto to_directory = [](const std::string& text) { return text == "off" ? std::string{} : text; };
    security_config read;
    if (from.is_scalar()) {
        read.keys = from.as(to_directory);
        return read;
    }
    from.read_map({{"keys", part(read.keys, scalar(to_directory))},
                   {"local_users", part(read.local_users, by_name(to_node_name))}});
    if (!read.is_on()) {
        from.fail("has no 'keys', the directory of the node's key");
    }
    return read;
}

federation_config federation_of(const yaml_value& from) {
    federation_config read;
    if (from.is_scalar()) {
        from.as([](const std::string& text) {
            if (text != "off") {
                throw invalid_value("'" + text + "' is not 'off', and has no keys 'nats' and 'pool'");
            }
            return text;
        });
        return read;
    }
    const auto read_tls = [&read](const yaml_value& tls) {
        tls.read_map({{"ca", part(read.tls_authority, scalar(to_absolute_path))},
                      {"certificate", part(read.tls_certificate, scalar(to_absolute_path))},
                      {"key", part(read.tls_key, scalar(to_absolute_path))}});
        if (read.tls_certificate.empty() != read.tls_key.empty()) {
            tls.fail("has only one of 'certificate' and 'key'");
        }
    };
    from.read_map({{"nats", part(read.servers, list(to_nats_url))},
                   {"pool", part(read.pool, scalar(to_federated_pool_name))},
                   {"credentials", part(read.credentials, scalar(to_absolute_path))},
                   {"token", part(read.token, scalar(to_absolute_path))},
                   {"tls", read_tls}});
    if (!read.is_on()) {
        from.fail("has no 'nats', the URL of a server");
    }
    if (read.pool.empty()) {
        from.fail("has no 'pool', the name of the node's pool");
    }
    return read;
}

isolation_limits isolation_limits_of(const yaml_value& from) {
    constexpr std::uint64_t least = std::uint64_t{64} << 20U;
    constexpr std::uint64_t most = std::uint64_t{1} << 40U;
    const auto to_memory = [](const std::string& text) { return to_size(text, least, most); };
    isolation_limits read;
    from.read_map({{"memory", part(read.memory, scalar(to_memory))},
                   {"open_files", part(read.open_files, count(16, 100'000))},
                   {"read", part(read.read, list(to_absolute_path))},
                   {"write", part(read.write, list(to_absolute_path))}});
    return read;
}

std::vector<plugin_config> plugins_of(const yaml_value& from) {
    const auto to_path = [](const std::string& path) {
        if (path.empty()) {
            throw invalid_value("is empty");
        }
        return path;
    };
    std::vector<plugin_config> plugins;
    from.read_list([&](const yaml_value& item) {
        auto& read = plugins.emplace_back();
        if (item.is_scalar()) {
            read.path = item.as(to_path);
            return;
        }
        bool limited = false;
        const auto read_limits = [&](const yaml_value& v) {
            limited = true;
            return isolation_limits_of(v);
        };
        item.read_map({{"path", part(read.path, scalar(to_path))},
                       {"config", part(read.config, [](const yaml_value& v) { return v.json(); })},
                       {"required", part(read.required, scalar(to_bool))},
                       {"sha256", part(read.sha256, scalar(to_sha256))},
                       {"isolation", part(read.isolated, scalar(to_isolated))},
                       {"limits", part(read.limits, read_limits)}});
        if (limited && !read.isolated) {
            item.fail("has 'limits', which require 'isolation: process'");
        }
        if (read.path.empty()) {
            item.fail("has no 'path'");
        }
    });
    return plugins;
}

constexpr std::size_t max_links = 20'000; // each takes a file descriptor

std::size_t max_of(const count_range& range) {
    return range.member == &limits::links || range.member == &limits::links_per_address ? max_links : range.most;
}

std::chrono::milliseconds to_milliseconds(const std::string& text, const time_range& range) {
    // Rounded up, because 0 turns some limits off.
    const auto span = std::chrono::ceil<std::chrono::milliseconds>(to_duration(text));
    const auto bound = [](std::chrono::milliseconds at) { return to_string(std::chrono::microseconds{at}); };
    if (span < range.least) {
        throw invalid_value("'" + text + "' is too short: " + bound(range.least) + " at least");
    }
    if (span > range.most) {
        throw invalid_value("'" + text + "' is too long: " + bound(range.most) + " at most");
    }
    return span;
}

void read_limits(const yaml_value& from, limits& into) {
    yaml_value::readers known;
    for (const auto& range : count_ranges) {
        const auto to = [&range](const std::string& text) { return to_size(text, range.least, max_of(range)); };
        known.emplace(range.name, part(into.*range.member, scalar(to)));
    }
    for (const auto& range : time_ranges) {
        const auto to = [&range](const std::string& text) { return to_milliseconds(text, range); };
        known.emplace(range.name, part(into.*range.member, scalar(to)));
    }
    from.read_map(known);
}

// -- values as YAML -------------------------------------------------------------------------------------------------

// Quoted, because YAML reads JSON strings.
std::string text_of(std::string_view value) {
    std::string out;
    json_writer w{out};
    w.value(value);
    return out;
}

std::string text_of(bool value) { return value ? "true" : "false"; }

std::string text_of(std::uint32_t number) { return std::to_string(number); }

std::string text_of(std::chrono::microseconds span) { return to_string(span); }

std::string text_of(std::optional<std::chrono::microseconds> bound) { return wake_within_text(bound); }

std::string text_of(const multicast_options& where) {
    return where.is_on() ? "{interface: " + text_of(where.interface) + ", group: " + where.group +
                               ", port: " + std::to_string(where.port) + ", required: " + text_of(where.required) + "}"
                         : "off";
}

std::string text_of(const std::vector<std::string>& items) {
    std::string all;
    for (const auto& item : items) {
        all += (all.empty() ? "" : ", ") + text_of(item);
    }
    return "[" + all + "]";
}

std::string text_of(const std::map<std::string, std::string>& peers) {
    std::string all;
    for (const auto& [name, url] : peers) {
        all += (all.empty() ? "" : ", ") + text_of(name) + ": " + text_of(url);
    }
    return "{" + all + "}";
}

std::string text_of(const security_config& security) {
    if (!security.is_on()) {
        return "off";
    }
    return security.local_users.empty()
               ? text_of(security.keys)
               : "{keys: " + text_of(security.keys) + ", local_users: " + text_of(security.local_users) + "}";
}

std::string text_of(const federation_config& federation) {
    if (!federation.is_on()) {
        return "off";
    }
    const auto file = [](const char* key, const std::string& path) {
        return path.empty() ? std::string{} : ", " + std::string{key} + ": " + text_of(path);
    };
    const auto tls = file("ca", federation.tls_authority) + file("certificate", federation.tls_certificate) +
                     file("key", federation.tls_key);
    return "{nats: " + text_of(federation.servers) + ", pool: " + text_of(federation.pool) +
           file("credentials", federation.credentials) + file("token", federation.token) +
           (tls.empty() ? "}" : ", tls: {" + tls.substr(2) + "}}");
}

std::string text_of(const log_config& log) {
    return "{level: " + std::string{to_string(log.level)} + ", format: " + std::string{to_string(log.format)} + "}";
}

std::string text_of(const std::vector<plugin_config>& plugins) {
    std::string all;
    for (const auto& p : plugins) {
        all +=
            "\n  - path: " + text_of(p.path) + "\n    config: " + p.config + "\n    required: " + text_of(p.required);
        all += p.sha256.empty() ? "" : "\n    sha256: " + text_of(p.sha256);
        if (p.isolated) {
            all += "\n    isolation: process\n    limits: {memory: " + std::to_string(p.limits.memory) +
                   ", open_files: " + std::to_string(p.limits.open_files) + ", read: " + text_of(p.limits.read) +
                   ", write: " + text_of(p.limits.write) + "}";
        }
    }
    return (all.empty() ? " []" : all) + "\n";
}

std::string text_of(const limits& bounds) {
    std::string text{"\n"};
    for (const auto& range : count_ranges) {
        text.append("  ").append(range.name) += ": " + std::to_string(bounds.*range.member) + "\n";
    }
    for (const auto& range : time_ranges) {
        text.append("  ").append(range.name) +=
            ": " + to_string(std::chrono::microseconds{bounds.*range.member}) + "\n";
    }
    return text;
}

// -- the settings ---------------------------------------------------------------------------------------------------

// A key of the configuration: how its value is read, and how it is written.
struct setting {
    std::string_view key;
    bool is_list; // of strings
    std::function<void(const yaml_value&, config&)> read;
    std::function<std::string(const config&)> text; // if it ends with a line feed, it has lines of its own
};

// \param read returns the value, or changes it
template <class T, class Read>
setting value(std::string_view key, T config::*member, Read read) {
    const auto assign = [=](const yaml_value& from, config& into) {
        if constexpr (std::is_invocable_v<Read, const yaml_value&, T&>) {
            read(from, into.*member);
        } else {
            into.*member = read(from);
        }
    };
    return {.key = key,
            .is_list = std::is_same_v<T, std::vector<std::string>>,
            .read = assign,
            .text = [=](const config& from) { return text_of(from.*member); }};
}

const std::vector<setting>& settings() {
    constexpr std::uint32_t max_workers = 1024;
    constexpr std::uint32_t max_queue = 1'000'000;
    const auto unchanged = [](const std::string& text) { return text; };
    static const std::vector<setting> all{value("node", &config::node, scalar(to_node_name)),
                                          value("pool", &config::pool, scalar(to_pool_name)),
                                          value("allow_clash", &config::allow_clash, scalar(to_bool)),
                                          value("listen", &config::listen, list(to_url)),
                                          value("insecure", &config::insecure, scalar(to_bool)),
                                          value("security", &config::security, security_of),
                                          value("networks", &config::networks, list(to_network)),
                                          value("multicast", &config::multicast, multicast_of),
                                          value("seeds", &config::seeds, list(to_url)),
                                          value("links", &config::links, list(to_node_name)),
                                          value("peers", &config::peers, by_name(to_url)),
                                          value("federation", &config::federation, federation_of),
                                          value("workers", &config::workers, count(1, max_workers)),
                                          value("queue", &config::queue, count(1, max_queue)),
                                          value("stuck_after", &config::stuck_after, scalar(to_duration)),
                                          value("replacements", &config::replacements, count(0, max_workers)),
                                          value("sharing", &config::sharing, scalar(to_bool)),
                                          value("drain", &config::drain, scalar(to_duration)),
                                          value("plugin_path", &config::plugin_path, list(unchanged)),
                                          value("plugins", &config::plugins, plugins_of),
                                          value("log", &config::log, read_log),
                                          value("busy_poll", &config::busy_poll, scalar(to_duration)),
                                          value("real_time", &config::real_time, count(0, 99)),
                                          value("wake_within", &config::wake_within, scalar(to_wake_within)),
                                          value("limits", &config::limits, read_limits)};
    return all;
}

// -- the file -------------------------------------------------------------------------------------------------------

// Calls `each(line, number)` for each line that is not blank or a comment.
template <class F>
void for_each_line(const std::string& text, F&& each) {
    constexpr std::string_view byte_order_mark{"\xEF\xBB\xBF"};
    std::istringstream in{text.starts_with(byte_order_mark) ? text.substr(byte_order_mark.size()) : text};
    std::string line;
    for (std::size_t number = 1; std::getline(in, line); ++number) {
        const auto begin = line.find_first_not_of(" \t\r");
        if (begin != std::string::npos && line[begin] != '#') {
            each(line, number);
        }
    }
}

// Checks the directives outside of documents, because the parser ignores unknown ones.
void check_directives(const std::string& text, const std::string& name) {
    bool outside = true; // of a document
    for_each_line(text, [&](const std::string& line, std::size_t number) {
        if (outside && line.starts_with('%')) {
            if (!line.starts_with("%YAML ") && !line.starts_with("%TAG ")) {
                throw config_error(name + ":" + std::to_string(number),
                                   "is not valid YAML: unknown directive: " + line.substr(0, 40));
            }
            return;
        }
        outside = line.starts_with("...");
    });
}

// A file without settings may contain only comments and document markers.
void check_empty(const std::string& text, const std::string& name) {
    for_each_line(text, [&](const std::string& line, std::size_t number) {
        if (!line.starts_with("---") && !line.starts_with("...") && !line.starts_with('%')) {
            throw config_error(name + ":" + std::to_string(number), "is not a setting: " + line.substr(0, 40));
        }
    });
}

YAML::Node parse(const std::string& text, const std::string& name) {
    try {
        const auto documents = YAML::LoadAll(text);
        if (documents.size() > 1) {
            throw config_error(name, "contains " + std::to_string(documents.size()) + " documents instead of one");
        }
        return documents.empty() ? YAML::Node{} : documents.front();
    } catch (const YAML::Exception& e) {
        const auto line = e.mark.line + 1;
        throw config_error(line > 0 ? name + ":" + std::to_string(line) : name, "is not valid YAML: " + e.msg);
    }
}

} // namespace

void read_config(const std::string& text, const std::string& name, config& into) {
    check_directives(text, name);
    const auto root = parse(text, name);
    if (root.IsNull()) {
        check_empty(text, name);
        return;
    }
    yaml_value::readers readers;
    for (const auto& each : settings()) {
        readers.emplace(each.key, [&](const yaml_value& v) { each.read(v, into); });
    }
    const yaml_source source{.name = name, .origins = into.origins};
    yaml_value{root, "", source}.read_map(readers);
}

void read_config_file(const std::string& path, config& into) {
    std::string text;
    if (const auto why = tool::read_file(path, text, max_file_size + 1)) {
        throw config_error(path, "cannot be read: " + why.message());
    }
    if (text.size() > max_file_size) {
        throw config_error(path, "has more than " + std::to_string(max_file_size) + " bytes");
    }
    read_config(text, path, into);
    into.file = path;
}

void apply_overrides(const overrides& wanted, config& into) {
    for (const auto& each : wanted) {
        // The file's values of the key and its parts are replaced.
        std::erase_if(into.origins, [&](const auto& origin) {
            const auto& known = origin.first;
            return known.starts_with(each.key) &&
                   (known.size() == each.key.size() || known[each.key.size()] == '[' || known[each.key.size()] == '.');
        });
        const auto known = std::ranges::find(settings(), each.key, &setting::key);
        YAML::Node value{known->is_list ? YAML::NodeType::Sequence : YAML::NodeType::Scalar};
        for (const auto& text : each.texts) {
            if (known->is_list) {
                value.push_back(text);
            } else {
                value = text;
            }
        }
        const yaml_source source{.name = each.source, .origins = into.origins, .is_file = false};
        known->read({value, each.key, source}, into);
    }
}

std::string to_yaml(const config& setup) {
    std::string out = setup.file.empty() ? "# no configuration file\n" : "# " + setup.file + "\n";
    for (const auto& each : settings()) {
        const std::string key{each.key};
        const auto text = each.text(setup);
        const auto origin = setup.origins.find(key);
        out.append(key).append(":");
        if (text.ends_with('\n')) {
            out.append(text);
            continue;
        }
        out.append(" ").append(text);
        if (origin != setup.origins.end()) {
            out.append("  # ").append(origin->second);
        }
        out.push_back('\n');
    }
    return out;
}

} // namespace cles::runtime
