// Just enough JSON for a scene: objects, arrays, strings without escapes, numbers, true and false.
#pragma once
#include <cctype>
#include <cstdlib>
#include <map>
#include <stdexcept>
#include <string>
#include <vector>

struct Json
{
    double number = 0;
    std::string text;
    std::vector<Json> items;
    std::map<std::string, Json> members;

    bool has(const char *name) const { return members.count(name) > 0; }
    const Json &operator[](const char *name) const { return members.at(name); }
    const Json &at(size_t index) const { return items.at(index); }
};

class JsonReader
{
public:
    explicit JsonReader(const std::string &source) : at(source.c_str()) {}

    Json value()
    {
        Json json;
        if (skip('{')) {
            while (!skip('}')) {
                std::string name = string();
                expect(':');
                json.members[name] = value();
                skip(',');
            }
        } else if (skip('[')) {
            while (!skip(']')) {
                json.items.push_back(value());
                skip(',');
            }
        } else if (peek() == '"') {
            json.text = string();
        } else if (std::isalpha(peek())) {
            json.number = peek() == 't';
            while (std::isalpha(*at))
                at++;
        } else {
            char *end;
            json.number = std::strtod(at, &end);
            if (end == at)
                throw std::runtime_error("not JSON");
            at = end;
        }
        return json;
    }

private:
    const char *at;

    int peek()
    {
        while (std::isspace((unsigned char)*at))
            at++;
        return (unsigned char)*at;
    }
    bool skip(char c) { return peek() == c && at++; }
    void expect(char c)
    {
        if (!skip(c))
            throw std::runtime_error("not JSON");
    }
    std::string string()
    {
        expect('"');
        const char *begin = at;
        while (*at && *at != '"')
            at++;
        std::string found(begin, at);
        expect('"');
        return found;
    }
};
