import "./theme/mantine.css";
import "./theme/tokens.css";
import { MantineProvider } from "@mantine/core";
import { QueryClient, QueryClientProvider } from "@tanstack/react-query";
import { StrictMode } from "react";
import { createRoot } from "react-dom/client";
import { retries } from "./api/problems";
import { App } from "./app";
import { theme } from "./theme/theme";

const root = document.getElementById("root");
if (root === null) throw new Error("index.html has no #root");

// The event stream invalidates cached responses, so nothing is refetched without a change.
const queries = new QueryClient({
  defaultOptions: {
    queries: { staleTime: Infinity, retry: retries, networkMode: "always" },
    mutations: { networkMode: "always" },
  },
});

createRoot(root).render(
  <StrictMode>
    <MantineProvider theme={theme} defaultColorScheme="auto" deduplicateCssVariables={false}>
      <QueryClientProvider client={queries}>
        <App />
      </QueryClientProvider>
    </MantineProvider>
  </StrictMode>,
);
