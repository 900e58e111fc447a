import "@mantine/core/styles.css";
import { Container, MantineProvider, Title } from "@mantine/core";
import { StrictMode } from "react";
import { createRoot } from "react-dom/client";

const root = document.getElementById("root");
if (root === null) throw new Error("index.html has no #root");

createRoot(root).render(
  <StrictMode>
    <MantineProvider defaultColorScheme="auto">
      <Container component="main" py="xl">
        <Title order={1}>Gainline</Title>
      </Container>
    </MantineProvider>
  </StrictMode>,
);
