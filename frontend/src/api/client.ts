/** Setup of the generated client: same origin, an idempotency key for every POST, problem documents as errors. */

import { client } from "./generated/client.gen";
import { controlHeader } from "./leases";
import { ApiError, problemFrom } from "./problems";

client.setConfig({ baseUrl: "" });

const OF_VEHICLE = /\/api\/vehicles\/(\d+)(\/|$)/;

client.interceptors.request.use((request) => {
  if (request.method === "POST") request.headers.set("Idempotency-Key", randomKey());
  const vehicleId = OF_VEHICLE.exec(new URL(request.url).pathname)?.[1];
  for (const [name, value] of Object.entries(vehicleId === undefined ? {} : controlHeader(Number(vehicleId)))) {
    request.headers.set(name, value);
  }
  return request;
});

interface Outcome<Data> {
  data?: Data | undefined;
  error?: unknown;
  response?: Response | undefined;
}

/** The response of a generated call; throws ApiError if it is refused or the server cannot be reached. */
export async function answer<Data>(call: Promise<Outcome<Data>>): Promise<Data> {
  let outcome: Outcome<Data>;
  try {
    outcome = await call;
  } catch {
    throw new ApiError(problemFrom(undefined, undefined));
  }
  const { data, error, response } = outcome;
  if (response === undefined) throw new ApiError(problemFrom(undefined, undefined));
  if (!response.ok) throw new ApiError(problemFrom(response.status, error));
  return data as Data;
}

/** A random key for one request. `crypto.randomUUID` is missing on plain http, where a tablet in the field is. */
export function randomKey(): string {
  const bytes = crypto.getRandomValues(new Uint8Array(16));
  return Array.from(bytes, (byte) => byte.toString(16).padStart(2, "0")).join("");
}
