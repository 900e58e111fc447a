import { Box, Skeleton, Title } from "@mantine/core";
import type { ReactNode } from "react";
import { ErrorNotice } from "./ErrorNotice";

interface Props {
  title: string;
  error: unknown;
  isPending: boolean;
  children: ReactNode;
}

/** A page with one form, while what the form needs is loaded, and after. */
export function FormPage({ title, error, isPending, children }: Props) {
  return (
    <Box maw={860} mx="auto">
      <Title order={1} mt={4} mb={16}>
        {title}
      </Title>
      {children}
      <ErrorNotice error={error} />
      {isPending && <Skeleton height={420} radius="md" aria-busy="true" />}
    </Box>
  );
}
