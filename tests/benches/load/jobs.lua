-- Small jobs end to end: every request submits another measure job and waits for its end.
local counter = 0
local threads = 0

function setup(thread)
  thread:set("number", threads)
  threads = threads + 1
end

function init(arguments)
  -- Another first number in every run, so that nothing is answered from an earlier one.
  math.randomseed(os.time())
  offset = math.random(1000000) * 100 + number * 17
end

function request()
  counter = counter + 1
  local tolerance = string.format("0.%d%09d", 1 + number, (offset * 1000 + counter) % 1000000000)
  local body = '{"lacuna":1,"kind":"measure","model":{"lacuna":1,"name":"bar","shape":{"family":"mesh",' ..
    '"vertices":[[0,0,0],[10,0,0]],"faces":[[0,1]]}},"params":{"tolerance_mm":' .. tolerance .. '}}'
  return wrk.format("POST", "/v1/jobs", { ["content-type"] = "application/json", ["prefer"] = "wait=30" }, body)
end

local refused = 0
function response(status, headers, body)
  if status ~= 200 then
    refused = refused + 1
    if refused == 1 then io.stderr:write(status .. " " .. body .. "\n") end
  end
end
