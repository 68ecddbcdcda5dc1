// SPDX-License-Identifier: BSL-1.0
#include "trust/rights_options.hpp"

#include <cles/json_writer.hpp>

#include "output/errors.hpp"
#include "output/terminal.hpp"

#include <CLI/App.hpp>
#include <CLI/Option.hpp>

#include <optional>
#include <string_view>

namespace tool {
namespace {

using texts = std::vector<std::string>;

// "all" and "none" are no rights: those have a space.
bool is_word_for_list(const texts& given) { return given == texts{"all"} || given == texts{"none"}; }

std::optional<texts> list_of(const texts& given) {
    if (given == texts{"all"}) {
        return std::nullopt;
    }
    return given == texts{"none"} ? texts{} : given;
}

void check_list(const std::string& option, const texts& given, std::string (*flaw_of)(std::string_view)) {
    if (is_word_for_list(given)) {
        return;
    }
    for (const auto& each : given) {
        const auto flaw = is_word_for_list({each}) ? "excludes any other " + option : flaw_of(each);
        if (!flaw.empty()) {
            throw usage_error(std::string{option}.append(" '").append(each).append("': ").append(flaw));
        }
    }
}

void add_list(CLI::App& command, const std::string& name, texts& list, const std::string& type,
              const std::string& help) {
    command.add_option(name, list, help)
        ->type_name(type)
        ->expected(1)
        ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
}

void write_list(cles::json_writer& w, std::string_view key, const texts& list) {
    w.key(key);
    w.begin_array();
    for (const auto& each : list) {
        w.value(std::string_view{each});
    }
    w.end_array();
}

} // namespace

void rights_options::add_to(CLI::App& command) {
    add_list(command, "--may", may_, "RIGHT", "What it may request, as in 'pull,bind *:localization'; all; none");
    add_list(command, "--offers", offers_, "RIGHT", "What others may request of it; all; none");
    add_list(command, "--forwards", forwards_, "NAME", "For which nodes it may forward, as in 'sat*'; all; none");
}

void rights_options::check() const {
    check_list("--may", may_, cles::security::flaw_of_right);
    check_list("--offers", offers_, cles::security::flaw_of_right);
    check_list("--forwards", forwards_, cles::security::flaw_of_name_pattern);
}

void rights_options::apply_to(cles::security::member_rights& rights) const {
    if (!may_.empty()) {
        rights.may = list_of(may_);
    }
    if (!offers_.empty()) {
        rights.offers = list_of(offers_);
    }
    if (!forwards_.empty()) {
        rights.forwards = list_of(forwards_).value_or(texts{"*"});
    }
}

std::string rights_text(const std::optional<texts>& listed) {
    if (!listed) {
        return "everything";
    }
    std::string out;
    for (const auto& each : *listed) {
        out.append(out.empty() ? "'" : ", '").append(printable(each)).append("'");
    }
    return out.empty() ? "nothing" : out;
}

std::string rights_lines(const cles::security::member_rights& rights) {
    return "may       " + rights_text(rights.may) + "\noffers    " + rights_text(rights.offers) + "\nforwards  " +
           rights_text(rights.forwards) + "\n";
}

void write_rights(cles::json_writer& w, const cles::security::member_rights& rights) {
    if (rights.may) {
        write_list(w, "may", *rights.may);
    }
    if (rights.offers) {
        write_list(w, "offers", *rights.offers);
    }
    write_list(w, "forwards", rights.forwards);
}

} // namespace tool
