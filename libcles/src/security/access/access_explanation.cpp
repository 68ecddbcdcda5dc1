// SPDX-License-Identifier: BSL-1.0
#include <cles/security/access.hpp>

#include "security/access/access_policy.hpp"
#include "security/fleet/key_directory.hpp"

#include <algorithm>
#include <optional>
#include <utility>

namespace cles::security {
namespace {

using cause = access_decision::cause;
using listed_rights = std::optional<std::vector<std::string>>;

/// Something that was decided by a policy.
struct decided_access {
    std::string_view requester{};
    std::string_view forwarder{}; ///< empty for none
    std::string_view target{};
    access_decision made{};
};

std::string reason_of(cause by) {
    switch (by) {
    case cause::permitted: return "permitted";
    case cause::exempt: return "exempt";
    case cause::unknown_requester: return "unknown_requester";
    case cause::unknown_target: return "unknown_target";
    case cause::unknown_forwarder: return "unknown_forwarder";
    case cause::not_forwarded: return "not_forwarded";
    case cause::rules_unreadable: return "rules_unreadable";
    case cause::rule: return "rule";
    case cause::may: return "may";
    case cause::offers: return "offers";
    }
    return {};
}

/// What decides it, for people.
class explanation {
  public:
    explanation(const access_policy& policy, const decided_access& decided) : policy_(policy), decided_(decided) {
        out_.allowed = decided.made.allowed();
        out_.reason = reason_of(decided.made.by);
    }

    access_answer run() {
        switch (decided_.made.by) {
        case cause::unknown_requester: return add_missing(decided_.requester);
        case cause::unknown_target: return add_missing(decided_.target);
        case cause::unknown_forwarder: return add_missing(decided_.forwarder);
        case cause::not_forwarded: add_forwarding(); return out_;
        case cause::exempt: out_.lines.emplace_back("rights and rules do not apply to this noun"); return out_;
        case cause::rules_unreadable:
            out_.lines.push_back("rules: everything is denied, because of an error: " + policy_.rules().error());
            return out_;
        case cause::rule:
        case cause::may:
        case cause::offers:
        case cause::permitted: break;
        }
        add_forwarding();
        add_rule();
        if (decided_.made.by != cause::rule) {
            add_rights(decided_.requester, "may", &member::may, decided_.made.may);
        }
        if (decided_.made.by != cause::rule && decided_.made.by != cause::may) {
            add_rights(decided_.target, "offers", &member::offers, decided_.made.offers);
        }
        return out_;
    }

  private:
    [[nodiscard]] const member& find(std::string_view name) const {
        return *std::find_if(policy_.members().begin(), policy_.members().end(),
                             [&](const member& each) { return each.name == name; });
    }

    access_answer add_missing(std::string_view name) {
        out_.lines.push_back("roster: " + std::string{name} + " is not a member");
        return out_;
    }

    void add_forwarding() {
        if (decided_.forwarder.empty()) {
            return;
        }
        std::string patterns;
        for (const auto& pattern : find(decided_.forwarder).forwards) {
            patterns.append(patterns.empty() ? "" : ", ").append(pattern);
        }
        out_.lines.push_back("roster, " + std::string{decided_.forwarder} +
                             " forwards: " + (patterns.empty() ? "nothing" : patterns));
    }

    void add_rule() {
        if (const auto* const rule = decided_.made.rule) {
            out_.lines.push_back("rules, line " + std::to_string(rule->line) + ": " + rule->text);
            out_.right = rule->allows ? "" : rule->text;
        } else if (!policy_.rules().rules().empty()) {
            out_.lines.emplace_back("rules: no line matches");
        }
    }

    void add_rights(std::string_view name, const char* kind, listed_rights member::*list, std::int32_t which) {
        const auto& listed = find(name).*list;
        std::string text;
        if (which == rights::everything) {
            text = "everything";
        } else if (which != rights::nothing) {
            text = (*listed)[static_cast<std::size_t>(which)];
            out_.right = text;
        } else {
            text = listed->empty() ? "nothing" : "not permitted by " + joined_rights(*listed);
        }
        out_.lines.push_back("roster, " + std::string{name} + " " + kind + ": " + text);
    }

    static std::string joined_rights(const std::vector<std::string>& listed) {
        std::string out;
        for (const auto& each : listed) {
            out.append(out.empty() ? "'" : ", '").append(each).append("'");
        }
        return out;
    }

    const access_policy& policy_;
    const decided_access& decided_;
    access_answer out_;
};

} // namespace

access_answer explain_access(const std::string& directory, const access_question& question) {
    const key_directory files{directory};
    const auto own_name = files.has_key() ? files.read_key().name : std::string{}; // an authority has none
    std::vector<std::string> warnings;
    const auto newest = files.read_newest_roster(warnings);
    if (!newest) {
        throw security_error{directory + " contains no roster"};
    }
    protocol::noun_view parts;
    std::string why;
    if (!protocol::parse_noun(question.noun, parts, why)) {
        throw security_error{why};
    }
    const auto target = parts.target == "self" ? std::string_view{own_name} : parts.target;
    if (target.empty()) {
        throw security_error{directory +
                             " contains no key of a node, which 'self' would be: name the node that serves"};
    }
    if (protocol::is_reserved_target(target)) {
        throw security_error{"name the node that serves: " + protocol::quoted(target) + " can be several"};
    }
    const access_policy policy{own_name, newest, own_name.empty() ? local_rules{} : read_local_rules(files.folder())};
    const decoded_noun noun{target, parts};
    const bool is_own = !own_name.empty() && question.requester == own_name && target != own_name;
    const auto made = is_own ? policy.sent(question.forwarder, question.asked, noun)
                             : policy.received(question.requester, question.forwarder, question.asked, noun);
    const decided_access decided{question.requester, question.forwarder, target, made};
    auto out = explanation{policy, decided}.run();
    out.warnings = std::move(warnings);
    return out;
}

} // namespace cles::security
