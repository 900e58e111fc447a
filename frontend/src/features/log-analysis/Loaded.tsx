import { Anchor, Skeleton } from "@mantine/core";
import { IconChevronLeft } from "@tabler/icons-react";
import type { UseQueryResult } from "@tanstack/react-query";
import type { ReactNode } from "react";
import { Link } from "wouter";
import { problemOf } from "../../api/problems";
import { NotFoundPage } from "../../ui/NotFound";
import { ErrorNotice } from "../../ui/Notices";

interface Props<Data> {
  query: UseQueryResult<Data>;
  children: (data: Data) => ReactNode;
}

const GONE: readonly unknown[] = [404, 422];

/** Something that may have been deleted, also while its page is open. */
export function Loaded<Data>({ query: { data, error }, children }: Props<Data>) {
  if (GONE.includes(problemOf(error)?.status)) return <NotFoundPage />;
  return (
    <>
      <ErrorNotice error={error} />
      {data ? children(data) : !error && <Skeleton height={420} radius="md" aria-busy="true" />}
    </>
  );
}

/** The way back to the library. */
export function LibraryLink() {
  return (
    <Anchor component={Link} to="/log-analysis" c="dimmed" display="inline-flex" lh="44px">
      <IconChevronLeft size={20} style={{ alignSelf: "center" }} aria-hidden />
      Log analysis
    </Anchor>
  );
}
